//! Does a stuck wheel bend the path as the paper says, and by how much?
//!
//! Draws the paths in a 6 m left turn (`figure7.svg`) and tabulates the change of heading rate for
//! radii from 1 to 10 m, left and right, beside recorded runs of an independent physics engine.
//! It fails if a sign is not the paper's.

use std::error::Error;
use std::path::Path;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::figure7::{self, Cell, Measured, RADII_M, RATIO_MAX};
use vigil_bench::{machine, quantile};
use vigil_recording::{frames, labels};
use vigil_robot::slip::SlipModel;

use super::Json;

/// Radius of the figure, m, and metres commanded in it.
const FIGURE_RADIUS_M: f64 = 6.0;
const FIGURE_LENGTH_M: f64 = 9.0;

/// Answers the question.
pub fn run(args: &Json) -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml"))?;
    let model = SlipModel::new(&robot)?;
    let data = root.join("tests/data/rover");
    let runs = frames::read(&data.join("learn_frames.csv.gz"), &robot)?;
    let labels = labels::read(&data.join("learn_runs.csv"), &robot)?;
    let label = |id| labels.iter().find(|label| label.run == id);
    let labelled: Vec<_> = runs
        .iter()
        .filter_map(|run| label(run.id).map(|label| (run, label)))
        .collect();
    let names: Vec<String> = robot.wheels.iter().map(|w| w.name.clone()).collect();
    let cells = figure7::cells(&model, &names, |radius_m, wheel| {
        Measured::of(&labelled, radius_m, wheel)
    })?;
    let signs_right = cells.iter().all(Cell::is_sign_right);
    let document = json!({
        "machine": machine::facts(),
        "signs_right": signs_right,
        "cells": cells.iter().map(Cell::json).collect::<Vec<Value>>(),
    });
    if args.json {
        println!("{document:#}");
        return judged(signs_right);
    }
    let mut archive = Archive::new("figure7")?;
    archive.store("figure7.json", &document)?;
    report(&mut archive, &cells, &names);
    let svg = figure(&model, &names)?;
    archive.store_text("figure7.svg", &svg)?;
    archive.close()?;
    judged(signs_right)
}

fn judged(signs_right: bool) -> Result<(), Box<dyn Error>> {
    match signs_right {
        true => Ok(()),
        false => Err("a stuck wheel does not bend every path as the paper says".into()),
    }
}

fn figure(model: &SlipModel, names: &[String]) -> Result<String, Box<dyn Error>> {
    let path = |stuck| figure7::path(model, 1.0 / FIGURE_RADIUS_M, stuck, FIGURE_LENGTH_M);
    let mut paths = vec![("nominal".to_owned(), path(None)?)];
    for (wheel, name) in names.iter().enumerate() {
        paths.push((format!("{name} stuck"), path(Some(wheel))?));
    }
    let title = "Left turn of 6 m radius, 9 m commanded: nominal and each wheel stuck";
    Ok(figure7::draw(title, &paths)?)
}

fn report(archive: &mut Archive, cells: &[Cell], names: &[String]) {
    archive.say("Change of heading rate, %: slip model / recorded runs of an independent physics");
    archive
        .say("engine (mean ± standard error; `-` where there are none), and the ratio of both.\n");
    for (turn, sign) in [("Left", 1.0), ("Right", -1.0)] {
        archive.say(&format!("{turn} turn\n"));
        archive.say(&format!("| radius, m | {} |", names.join(" | ")));
        archive.say(&format!("|---{}|", "|---".repeat(names.len())));
        for radius_m in RADII_M {
            let row: Vec<String> = cells
                .iter()
                .filter(|cell| cell.radius_m == sign * radius_m)
                .map(entry)
                .collect();
            archive.say(&format!("| {radius_m} | {} |", row.join(" | ")));
        }
        archive.say("");
    }
    summarise(archive, cells);
}

fn entry(cell: &Cell) -> String {
    let Some(measured) = &cell.measured else {
        return format!("{:+.1} / -", cell.model_percent);
    };
    let error = (measured.error_rad_m * measured.percent / measured.rad_m).abs();
    let ratio = cell
        .ratio()
        .map_or_else(|| "ns".into(), |r| format!("{r:.2}"));
    format!(
        "{:+.1} / {:+.1} ± {error:.1} ({ratio})",
        cell.model_percent, measured.percent
    )
}

fn summarise(archive: &mut Archive, cells: &[Cell]) {
    let right = cells.iter().filter(|cell| cell.is_sign_right()).count();
    let total = cells.len();
    archive.say(&format!(
        "Sign as in the paper, by model and runs: {right} of {total} cells."
    ));
    let with_data = cells.iter().filter(|cell| cell.measured.is_some()).count();
    let mut ratios: Vec<f64> = cells.iter().filter_map(Cell::ratio).collect();
    let (n, unclear) = (ratios.len(), with_data - ratios.len());
    let missing: Vec<&Cell> = cells.iter().filter(|cell| cell.misses()).collect();
    let [low, middle, high] = [0.0, 0.5, 1.0].map(|q| quantile(&mut ratios, q));
    archive.say(&format!(
        "Size: {} of {n} significant cells within a factor of {RATIO_MAX} ({with_data} have runs; \
         in {unclear} the change is below two standard errors). Ratio model / runs: least \
         {low:.2}, median {middle:.2}, greatest {high:.2}.",
        n - missing.len()
    ));
    for cell in missing {
        let Some(measured) = &cell.measured else {
            continue;
        };
        archive.say(&format!(
            "- misses: {} at {:+} m: {:+.4} rad/m by the model, {:+.4} ± {:.4} in the runs; the \
             difference is {:.1} % of the heading rate",
            cell.name,
            cell.radius_m,
            cell.model_rad_m,
            measured.rad_m,
            measured.error_rad_m,
            (cell.model_percent - measured.percent).abs()
        ));
    }
}
