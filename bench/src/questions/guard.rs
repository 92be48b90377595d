//! Does the guard find every bad frame by its right cause, and let pass what is the filters'?

use std::error::Error;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::guard::{faults, sensors, stream::Stream};
use vigil_bench::matched::in_parallel;
use vigil_bench::shares::Share;
use vigil_bench::simulated::Rover;
use vigil_recording::frames;

/// Injects faults into a stream of frames, and counts what is found.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Injections of each kind.
    #[arg(long, value_name = "N", default_value_t = 300)]
    injections: usize,
    /// Seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// What became of one kind of fault.
struct Row {
    kind: String,
    found: Share,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rover = Rover::read(&root)?;
    let recording = root.join("tests/data/rover/learn_frames.csv.gz");
    let runs = frames::read(&recording, &rover.robot)?;
    let recorded = &runs.first().ok_or("the recording is empty")?.frames;
    let (mut rows, mut not_finite_past, mut good_refused) = (Vec::new(), 0, 0);
    for (number, (kind, inject)) in faults::KINDS.into_iter().enumerate() {
        let mut random = Pcg64Mcg::seed_from_u64(args.seed.wrapping_add(number as u64));
        let mut stream = Stream::new(&rover.robot, recorded);
        (0..20).for_each(|_| {
            stream.send_good();
        });
        let mut found = Share::default();
        for _ in 0..args.injections {
            found.add(inject(&mut stream, &mut random));
            // As many good ones as the worst kind needs to be trusted again, at a random phase.
            for _ in 0..random.random_range(17..60) {
                good_refused += u64::from(!stream.send_good());
            }
        }
        not_finite_past += stream.not_finite_past;
        rows.push(Row {
            kind: kind.to_owned(),
            found,
        });
    }
    rows.extend(sensor_rows(args, &rover)?);
    report(args, &rows, (not_finite_past, good_refused))
}

/// What the filters made of broken sensors, and that the guard let them see it.
fn sensor_rows(args: &Args, rover: &Rover) -> Result<Vec<Row>, Box<dyn Error>> {
    let jobs = sensors::jobs(args.injections, args.seed);
    let run = |job: &sensors::Job| job.run(rover).map_err(|e| e.to_string());
    let found: Result<Vec<_>, String> = in_parallel(&jobs, run).into_iter().collect();
    let found: Vec<_> = jobs.iter().zip(found?).collect();
    let share = |how: &str, is: fn(&sensors::Found) -> bool| {
        let of = found.iter().filter(|(job, _)| job.how == how);
        Share::of(of, |(_, found)| is(found))
    };
    let mut rows = Vec::new();
    for how in sensors::ENCODER {
        rows.push(Row {
            kind: format!("encoder {how}: named by the identifier"),
            found: share(how, |found| found.is_detected && found.is_named),
        });
        rows.push(Row {
            kind: format!("encoder {how}: let pass by the guard"),
            found: share(how, |found| found.refused == 0),
        });
    }
    let how = sensors::POSE_DRIFT;
    rows.push(Row {
        kind: "pose drifting by 0.02 or 0.05 m/s: an alarm in 5 s".to_owned(),
        found: share(how, |found| found.is_detected),
    });
    rows.push(Row {
        kind: "pose drifting: let pass by the guard".to_owned(),
        found: share(how, |found| found.refused == 0),
    });
    Ok(rows)
}

fn report(args: &Args, rows: &[Row], (past, refused): (u64, u64)) -> Result<(), Box<dyn Error>> {
    let document = json!({
        "injections": args.injections,
        "seed": args.seed,
        "kinds": rows.iter().map(|row| json!({
            "kind": row.kind, "found": row.found.hits, "of": row.found.of,
        })).collect::<Vec<_>>(),
        "not_finite_past_the_guard": past,
        "good_frames_refused": refused,
    });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("guard")?;
    archive.say(&format!(
        "`scripts/bench guard --injections {} --seed {}`\n\nFaults injected at random phases into \
         recorded frames that travel as datagrams; found means: refused with the right cause, \
         counted exactly, and the next good frame taken. Bound: the share that may be missed with \
         95 % confidence, by the rule of three.\n",
        args.injections, args.seed
    ));
    archive.say("| kind | found | of | missed below |\n|---|---|---|---|");
    for Row { kind, found } in rows {
        let bound = if found.hits == found.of {
            format!("{:.1} %", 300.0 / found.of.max(1) as f64)
        } else {
            format!("{} missed", found.of - found.hits)
        };
        archive.say(&format!(
            "| {kind} | {} | {} | {bound} |",
            found.hits, found.of
        ));
    }
    archive.say(&format!(
        "\nNumbers that are not finite past the guard: {past}. Good frames refused: {refused}."
    ));
    archive.store("guard.json", &document)?;
    archive.close()?;
    Ok(())
}
