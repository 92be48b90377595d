//! Raw data of a cell: every cycle, every late wake-up of a canary, the graph file, the document.
//! Percentiles and histograms of any part follow from the cycles.

use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::cell::Cell;
use crate::chain::STAGE_NAMES;

/// Writes everything of a cell into `folder`.
///
/// # Errors
/// The file system's.
pub fn write(cell: &Cell, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    packed(&folder.join("cycles.csv.gz"), |out| cycles(cell, out))?;
    packed(&folder.join("canaries.csv.gz"), |out| canaries(cell, out))?;
    fs::write(folder.join("graph.toml"), &cell.graph_file)?;
    fs::write(folder.join("cell.json"), format!("{:#}\n", cell.json()))?;
    Ok(())
}

fn packed(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let mut out = GzEncoder::new(fs::File::create(path)?, Compression::best());
    write(&mut out)?;
    out.finish()?.sync_all()
}

/// Each instant of the schedule: until when it was answered, whose miss it is, and the two parts of
/// each stage; these are empty for an instant that a stage left out.
fn cycles(cell: &Cell, out: &mut dyn Write) -> std::io::Result<()> {
    write!(out, "t_schedule_ns,end_to_end_ns,missed_by")?;
    for name in STAGE_NAMES {
        write!(out, ",{name}_hand_over_ns,{name}_compute_ns")?;
    }
    writeln!(out)?;
    let mut misses = cell.misses.iter().peekable();
    for cycle in &cell.cycles {
        let miss = misses.next_if(|miss| miss.t_schedule_ns == cycle.t_schedule_ns);
        let missed_by = match miss.map(|miss| miss.is_machine) {
            Some(true) => "machine",
            Some(false) => "vigil",
            None => "",
        };
        let took_ns = cycle.end_to_end_ns();
        write!(out, "{},{took_ns},{missed_by}", cycle.t_schedule_ns)?;
        match cycle.stages {
            Some(stages) => {
                for stage in stages {
                    write!(out, ",{},{}", stage.hand_over_ns, stage.compute_ns)?;
                }
            }
            None => write!(out, "{}", ",,".repeat(STAGE_NAMES.len()))?,
        }
        writeln!(out)?;
    }
    Ok(())
}

fn canaries(cell: &Cell, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "core,t_schedule_ns,late_ns")?;
    for canary in &cell.canaries {
        for late in &canary.late {
            let core = canary.placement.core;
            writeln!(out, "{core},{},{}", late.t_schedule_ns, late.late_ns)?;
        }
    }
    Ok(())
}
