//! Pictures as a terminal shows them.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::Color;

use super::frame::{draw, text};
use super::palette::Palette;
use super::scene::Scene;
use crate::status::Document;
use crate::watch::View;
use crate::watch::sample::{self, NOW, NOW_NS, setup};

/// How a view is drawn.
struct Picture {
    columns: u16,
    rows: u16,
    palette: Palette,
    has_help: bool,
}

const SMALL: Picture = Picture {
    columns: 80,
    rows: 24,
    palette: Palette::COLOURED,
    has_help: false,
};

const LARGE: Picture = Picture {
    columns: 120,
    rows: 40,
    ..SMALL
};

fn drawn(make: fn(&vigil_setup::Setup) -> View, picture: &Picture) -> Buffer {
    let setup = setup();
    let view = make(&setup);
    let document = Document::new(&view, &setup, NOW);
    let scene = Scene {
        now_ns: NOW_NS,
        has_help: picture.has_help,
        ..Scene::new(&document, &view, picture.palette)
    };
    let backend = TestBackend::new(picture.columns, picture.rows);
    let mut terminal = Terminal::new(backend).unwrap();
    let drawing = |frame: &mut ratatui::Frame<'_>| draw(&scene, frame.area(), frame.buffer_mut());
    terminal.draw(drawing).unwrap();
    terminal.backend().buffer().clone()
}

/// The rows of a picture, without blanks at their ends.
fn rows(buffer: &Buffer) -> Vec<String> {
    let row = |y| {
        let cells = (0..buffer.area.width).map(|x| buffer[(x, y)].symbol());
        cells.collect::<String>().trim_end().to_owned()
    };
    (0..buffer.area.height).map(row).collect()
}

/// Rows without the first, which ends in the time of day.
fn demand(found: &[String], expected: &[&str]) {
    assert_eq!(found[..expected.len()], *expected, "{}", found.join("\n"));
}

/// The colour of the first cell of a word.
fn colour(buffer: &Buffer, word: &str) -> Color {
    let rows = rows(buffer);
    let found = rows.iter().enumerate().find_map(|(y, row)| {
        let at = row.find(word)?;
        Some((row[..at].chars().count() as u16, y as u16))
    });
    buffer[found.unwrap()].fg
}

#[test]
fn a_healthy_graph_says_so() {
    let buffer = drawn(sample::healthy, &SMALL);
    let rows = rows(&buffer);
    assert!(
        rows[0].starts_with("vigil  rover  OK  100.0 Hz  up 1 min 2 s "),
        "{}",
        rows[0]
    );
    assert_eq!(rows[0].chars().count(), 80);
    demand(
        &rows[1..],
        &[
            "faults    no faults",
            "belief    p(fault)     0.000  ··············                    ▁ armed (0)",
            "          UNKNOWN      0.001  ··············                    ▁",
            "          ND           0.999  ██████████████                    █",
            "decision  go_on  worth 1.50; slow_down is worth 4.50 less",
            "          believed: ND 0.750  UNKNOWN 0.250  STUCK 0.000",
            "services               us worst budget missed over lo/la/re core       us, 60 s",
            "sensor-sim running     24  1529   5000      0    0 0/0/0    0 fifo:50  █████████",
            "detector   running     24  1529   5000      0    0 0/0/0    0 fifo:50  █████████",
            "identifier running     24  1529   5000      1    0 0/0/0    0 fifo:50  █████████",
            "supervisor running     24  1529   5000      0    0 0/0/0    0 fifo:50  █████████",
            "time      schedule to action p50 250  p90 290  p99 299  max 300 us  (10.0 s)",
            "input     13 of 13 channels valid; none rejected",
            "events",
        ],
    );
    assert_eq!(colour(&buffer, "OK"), Color::Indexed(36));
}

#[test]
fn a_fault_comes_first_with_why_and_what_is_done() {
    let buffer = drawn(sample::faulty, &SMALL);
    let rows = rows(&buffer);
    assert!(
        rows[0].starts_with("vigil  rover  FAULT  100.0 Hz"),
        "{}",
        rows[0]
    );
    demand(&rows[1..], &FAULTY);
    let newest = "supervisor  fault       RM_STUCK is active";
    let last = rows.iter().rfind(|row| !row.is_empty()).unwrap();
    assert!(last.ends_with(newest), "{last}");
    assert_eq!(colour(&buffer, "FAULT"), Color::Indexed(166));
    assert_eq!(colour(&buffer, "! RM_STUCK"), Color::Indexed(166));
}

const FAULTY: [&str; 5] = [
    "faults    ! RM_STUCK     ACTIVE  for 3 min  2 times  p 0.998  compensate",
    "            stuck; wheel rate RM says so by 5.4 nat; runner-up RM_ENC",
    "belief    p(fault)     0.998  ██████████████                    █ ALARM (1)",
    "          RM_STUCK     0.998  ██████████████                    █",
    "          UNKNOWN      0.001  ··············                    ▁",
];

#[test]
fn a_side_is_drawn_where_none_of_its_wheels_is_as_probable() {
    let rows = rows(&drawn(sample::sided, &SMALL));
    let beliefs = rows[4..7].iter().map(|row| row[..28].trim());
    let expected = [
        "RSS          0.900",
        "RM_STUCK     0.500",
        "RF_STUCK     0.400",
    ];
    assert_eq!(beliefs.collect::<Vec<_>>(), expected, "{}", rows.join("\n"));
}

#[test]
fn more_room_has_longer_bars_and_curves() {
    let rows = rows(&drawn(sample::faulty, &LARGE));
    assert_eq!(rows.len(), 40);
    assert_eq!(rows[0].chars().count(), 120);
    let belief = rows.iter().find(|row| row.contains("p(fault)")).unwrap();
    assert_eq!(belief.matches('█').count(), 15, "{belief}");
    assert!(belief.ends_with("ALARM (1)"), "{belief}");
}

#[test]
fn what_is_stale_says_so_and_is_grey() {
    let buffer = drawn(sample::silent, &SMALL);
    let rows = rows(&buffer);
    assert!(
        rows[0].starts_with("vigil  rover  STALE, UNSUPERVISED"),
        "{}",
        rows[0]
    );
    assert_eq!(
        rows[1],
        "how the robot is, is not known: all services have been silent for 5.0 s"
    );
    assert!(
        rows[2].starts_with("faults    ! RM_STUCK     ACTIVE"),
        "{}",
        rows[2]
    );
    assert!(
        rows.iter().any(|row| row.starts_with("detector   GONE")),
        "{rows:#?}"
    );
    let expired = "decision  compensate EXPIRED  worth 1.50; go_on is worth 4.50 less";
    assert!(rows.iter().any(|row| row == expired), "{rows:#?}");
    assert!(rows[4].ends_with("SILENT"), "{}", rows[4]);
    let grey = (2..24).all(|y| (0..80).all(|x| buffer[(x, y)].fg == Color::Indexed(245)));
    assert!(grey, "the past is grey, whatever it was");
    assert_eq!(colour(&buffer, "STALE"), Color::Indexed(166));
}

#[test]
fn what_has_ended_says_so_and_waits() {
    let ended = |setup: &vigil_setup::Setup| View {
        has_ended: true,
        launcher: None,
        ..sample::faulty(setup)
    };
    let rows = rows(&drawn(ended, &SMALL));
    assert!(rows[0].starts_with("vigil  rover  ENDED  "), "{}", rows[0]);
    let wanted = "the graph has ended: joined again once it is started; q quits";
    assert_eq!(rows[1], wanted);
}

#[test]
fn without_colours_no_cell_has_one_and_every_word_is_the_same() {
    for make in [sample::healthy, sample::faulty, sample::silent] {
        let plain = Picture {
            palette: Palette::PLAIN,
            ..SMALL
        };
        let (coloured, plain) = (drawn(make, &SMALL), drawn(make, &plain));
        assert_eq!(rows(&coloured), rows(&plain));
        let is_plain = |cell: &ratatui::buffer::Cell| [cell.fg, cell.bg] == [Color::Reset; 2];
        assert!(plain.content.iter().all(is_plain));
        assert!(!coloured.content.iter().all(is_plain));
    }
}

#[test]
fn colours_are_refused_by_a_variable_that_is_not_empty() {
    assert_eq!(Palette::new(None), Palette::COLOURED);
    assert_eq!(Palette::new(Some("".as_ref())), Palette::COLOURED);
    assert_eq!(Palette::new(Some("1".as_ref())), Palette::PLAIN);
}

#[test]
fn help_lies_over_the_picture_and_no_size_is_too_small() {
    let help = Picture {
        has_help: true,
        ..SMALL
    };
    let rows = rows(&drawn(sample::faulty, &help));
    assert!(
        rows.iter()
            .any(|row| row.contains("q, Esc, Ctrl-C    quit"))
    );
    for (columns, lines) in [(1, 1), (20, 5), (60, 20), (79, 10), (300, 100)] {
        for has_help in [false, true] {
            let size = Picture {
                columns,
                rows: lines,
                has_help,
                ..SMALL
            };
            drawn(sample::faulty, &size);
        }
    }
}

#[test]
fn a_picture_as_text_is_the_small_one() {
    let setup = setup();
    let view = sample::faulty(&setup);
    let document = Document::new(&view, &setup, NOW);
    let scene = Scene {
        now_ns: NOW_NS,
        ..Scene::new(&document, &view, Palette::PLAIN)
    };
    let rows = rows(&drawn(sample::faulty, &SMALL));
    let text = text(&scene);
    // The time of day may have moved on.
    let text: Vec<&str> = text.lines().collect();
    assert_eq!(text[1..], rows[1..text.len()]);
    assert!(text.len() > 18, "{text:#?}");
}
