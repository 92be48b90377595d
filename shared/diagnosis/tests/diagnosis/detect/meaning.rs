//! The tests of a publisher over recorded runs: silent on all of them, faulty or not, and loud once
//! the motion shows what is wrong.

use vigil_blocks::SensorFrame;
use vigil_robot::publisher_check::{FindingKind, PublisherCheck};

use crate::recorded::{model, path, robot, runs, unseen};

/// All that is found in a run, and when, s after the first motion.
fn found(frames: &[SensorFrame], spoil: impl Fn(&mut SensorFrame)) -> Vec<(FindingKind, f64)> {
    let mut meaning = PublisherCheck::new(&robot());
    let mut all = Vec::new();
    let mut began_s = None;
    for frame in frames {
        let mut frame = *frame;
        spoil(&mut frame);
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if frame.command[1].abs() > 0.02 {
            began_s.get_or_insert(t_s);
        }
        if let Some(finding) = meaning.take(&frame) {
            all.push((finding.kind, t_s - began_s.unwrap_or(0.0)));
        }
    }
    all
}

#[test]
fn nothing_is_found_in_recorded_runs_with_or_without_faults() {
    let robot = robot();
    assert!(path("config").exists() && model().interval_s > 0.0);
    let (runs, labels) = runs();
    assert!(runs.len() > 50 && labels.len() == runs.len());
    let mut unjudged = 0;
    for run in runs {
        let mut meaning = PublisherCheck::new(&robot);
        for frame in &run.frames {
            assert_eq!(meaning.take(frame), None, "run {}", run.id);
        }
        unjudged += usize::from(!meaning.scope().unjudged.is_empty());
    }
    assert!(unjudged < runs.len(), "no run turns enough");
}

#[test]
fn what_is_wrong_is_found_in_the_motion_that_shows_it() {
    type Spoil = fn(&mut SensorFrame);
    let spoils: [(FindingKind, Spoil); 10] = [
        (FindingKind::Travel, |f| {
            (f.channel[0], f.channel[1]) = (1e3 * f.channel[0], 1e3 * f.channel[1])
        }),
        (FindingKind::Heading, |f| f.channel.swap(0, 1)),
        (FindingKind::Turn, |f| {
            f.channel[2] = f.channel[2].to_degrees()
        }),
        (FindingKind::Turn, |f| f.channel[2] = -f.channel[2]),
        (FindingKind::Rates, |f| {
            f.channel[3..9].iter_mut().for_each(|r| *r = r.to_degrees())
        }),
        (FindingKind::RateSign, |f| {
            f.channel[3 + 4] = -f.channel[3 + 4]
        }),
        (FindingKind::RateSign, |f| {
            f.channel[6..9].iter_mut().for_each(|r| *r = -*r)
        }),
        (FindingKind::Sides, |f| f.channel.swap(4, 7)),
        (FindingKind::SteerSign, |f| {
            f.channel[9..13]
                .iter_mut()
                .for_each(|angle| *angle = -*angle)
        }),
        (FindingKind::SteerSign, |f| f.channel.swap(9, 10)),
    ];
    let (runs, labels) = runs();
    let nominal = labels.iter().filter(|label| label.mode == "ND");
    let nominal: Vec<u32> = nominal.map(|label| label.run).collect();
    let mut missed = Vec::new();
    for (kind, spoil) in spoils {
        let mut slowest: f64 = 0.0;
        let (mut seen, mut turning) = (0, 0);
        for run in runs.iter().filter(|run| nominal.contains(&run.id)) {
            // Straight runs show nothing of turns.
            if run.frames.iter().all(|f| f.command[0].abs() < 0.35) {
                continue;
            }
            turning += 1;
            let all = found(&run.frames, spoil);
            if let Some((_, after_s)) = all.iter().find(|(found, _)| *found == kind) {
                seen += 1;
                slowest = slowest.max(*after_s);
            }
        }
        eprintln!("{kind:?}: {seen} of {turning}, slowest {slowest:.2} s");
        // Exchanged axes hide in some headings.
        if turning <= 3 || 5 * seen < 4 * turning {
            missed.push((kind, seen, turning, slowest));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
    let (frames, _) = unseen("ND", "");
    assert_eq!(found(&frames, |_| ()), []);
}
