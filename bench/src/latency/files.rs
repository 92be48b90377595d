//! Files of a cell that other programs read.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use super::canary::LateWakeUp;
use flate2::Compression;
use flate2::write::GzEncoder;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::IntervalLogWriterBuilder;
use vigil_cycle::Latency;

use super::cell::Cell;
use super::cycles::{Cycle, STAGE_NAMES, Stage};

/// Lateness of a canary from which it is told wake-up by wake-up, ns; about a miss all are.
const CANARY_FROM_NS: u64 = 200_000;

/// Cycles that are written one by one: of more, the longest; the interval log tells of the rest.
const RAW_MAX: usize = 25_000;

/// Writes everything of a cell into `folder`: percentile spectra, interval log, misses, the
/// canaries' late wake-ups, raw cycles, the graph file and the document.
///
/// # Errors
/// The file system's.
pub fn write(cell: &Cell, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    let mut spectra = vec![
        ("end-to-end".to_owned(), &cell.graph.end_to_end),
        ("compute".to_owned(), &cell.graph.compute),
        ("hand-over".to_owned(), &cell.graph.hand_over),
        ("floor-end-to-end".to_owned(), &cell.floor.end_to_end),
        ("floor-hand-over".to_owned(), &cell.floor.hand_over),
    ];
    for (name, (hand_over, compute)) in STAGE_NAMES.iter().zip(&cell.graph.stages) {
        spectra.push((format!("{name}-hand-over"), hand_over));
        spectra.push((format!("{name}-compute"), compute));
    }
    for (name, latency) in spectra {
        fs::write(folder.join(format!("{name}.hgrm")), hgrm(latency))?;
    }
    let whole = hlog(&cell.cycles, "end to end", |c| Some(c.end_to_end_ns()))?;
    fs::write(folder.join("end-to-end.hlog"), whole)?;
    for (i, name) in STAGE_NAMES.iter().enumerate() {
        let took = |stage: Stage| stage.hand_over_ns + stage.compute_ns;
        let of = |cycle: &Cycle| cycle.stages.map(|stages| took(stages[i]));
        let log = hlog(&cell.cycles, &format!("{name}, from input to output"), of)?;
        fs::write(folder.join(format!("{name}.hlog")), log)?;
    }
    fs::write(folder.join("misses.csv"), misses(cell))?;
    fs::write(folder.join("canaries.csv"), canaries(cell))?;
    let start_ns = cell.cycles.first().map_or(0, |c| c.t_schedule_ns);
    if cell.cycles.len() <= RAW_MAX {
        let raw = raw(&cell.cycles, start_ns)?;
        fs::write(folder.join("cycles.csv.gz"), raw)?;
    } else {
        let raw = raw(&longest(&cell.cycles, RAW_MAX), start_ns)?;
        fs::write(folder.join("longest-cycles.csv.gz"), raw)?;
    }
    fs::write(folder.join("graph.toml"), &cell.graph_file)?;
    fs::write(folder.join("cell.json"), format!("{:#}\n", cell.json()))?;
    Ok(())
}

/// The percentile spectrum in us, in the form that HdrHistogram's plotter reads.
#[must_use]
pub fn hgrm(latency: &Latency) -> String {
    let histogram = latency.histogram();
    let us = |ns: u64| ns as f64 * 1e-3;
    let mut text = String::from("       Value     Percentile TotalCount 1/(1-Percentile)\n\n");
    let mut count = 0;
    for value in histogram.iter_quantiles(5) {
        let quantile = value.quantile_iterated_to();
        count += value.count_since_last_iteration();
        let at = us(value.value_iterated_to());
        let _ = if quantile < 1.0 {
            let inverse = 1.0 / (1.0 - quantile);
            writeln!(text, "{at:12.3} {quantile:14.12} {count:10} {inverse:14.2}")
        } else {
            writeln!(text, "{at:12.3} {quantile:14.12} {count:10}            inf")
        };
    }
    let (mean, deviation) = (histogram.mean() * 1e-3, histogram.stdev() * 1e-3);
    let (max, total) = (us(latency.percentiles().max_ns), histogram.len());
    let _ = writeln!(
        text,
        "#[Mean    = {mean:12.3}, StdDeviation   = {deviation:12.3}]"
    );
    let _ = writeln!(text, "#[Max     = {max:12.3}, TotalCount     = {total:12}]");
    text
}

/// Latencies in ns, one histogram a second: of each cycle what `of` says, if anything.
fn hlog(
    cycles: &[Cycle],
    what: &str,
    of: impl Fn(&Cycle) -> Option<u64>,
) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut text = Vec::new();
    let mut serializer = V2DeflateSerializer::new();
    let start_ns = cycles.first().map_or(0, |c| c.t_schedule_ns);
    let at = |ns: u64| UNIX_EPOCH + Duration::from_nanos(ns);
    let mut writer = IntervalLogWriterBuilder::new()
        .add_comment(&format!("{what}, ns; times are CLOCK_MONOTONIC"))
        .with_start_time(at(start_ns))
        .with_base_time(at(start_ns))
        .begin_log_with(&mut text, &mut serializer)?;
    let second = |cycle: &Cycle| (cycle.t_schedule_ns - start_ns) / 1_000_000_000;
    for group in cycles.chunk_by(|a, b| second(a) == second(b)) {
        let mut histogram = Histogram::<u64>::new(3)?;
        for ns in group.iter().filter_map(&of) {
            histogram.record(ns.max(1))?;
        }
        let from = Duration::from_secs(second(&group[0]));
        writer.write_histogram(&histogram, from, Duration::from_secs(1), None)?;
    }
    drop(writer);
    Ok(text)
}

fn misses(cell: &Cell) -> String {
    let mut text = String::from("t_schedule_ns,end_to_end_us,overrun_us,whose,one_stall\n");
    for miss in &cell.misses {
        let whose = if miss.is_machine { "machine" } else { "ours" };
        let took = (miss.t_done_ns - miss.t_schedule_ns) as f64 * 1e-3;
        let over = miss.overrun_ns as f64 * 1e-3;
        let (t_ns, one) = (miss.t_schedule_ns, u8::from(miss.is_one_stall));
        let _ = writeln!(text, "{t_ns},{took:.3},{over:.3},{whose},{one}");
    }
    text
}

/// Wake-ups of the canaries that were late enough to matter.
fn canaries(cell: &Cell) -> String {
    let mut text = String::from("core,t_schedule_ns,late_us\n");
    let is_about_a_miss = |late: &LateWakeUp| {
        let until_ns = late.t_schedule_ns + late.late_ns;
        let first = cell
            .misses
            .partition_point(|miss| miss.t_done_ns < late.t_schedule_ns);
        let miss = cell.misses.get(first);
        miss.is_some_and(|miss| miss.t_schedule_ns <= until_ns)
    };
    let matters = |late: &&LateWakeUp| late.late_ns >= CANARY_FROM_NS || is_about_a_miss(late);
    for seen in &cell.canaries {
        for late in seen.late.iter().filter(matters) {
            let (core, us) = (seen.placement.core, late.late_ns as f64 * 1e-3);
            let _ = writeln!(text, "{core},{},{us:.3}", late.t_schedule_ns);
        }
    }
    text
}

/// The `count` cycles that took longest, in their order.
fn longest(cycles: &[Cycle], count: usize) -> Vec<Cycle> {
    let mut longest = cycles.to_vec();
    longest.sort_unstable_by_key(|cycle| std::cmp::Reverse(cycle.end_to_end_ns()));
    longest.truncate(count);
    longest.sort_unstable_by_key(|cycle| cycle.t_schedule_ns);
    longest
}

/// Each cycle: when it was due since `start_ns`, and the two parts of each stage; empty for a
/// cycle that a stage left out.
fn raw(cycles: &[Cycle], start_ns: u64) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut text = String::from("t_us,end_to_end_ns");
    for name in STAGE_NAMES {
        let _ = write!(text, ",{name}_hand_over_ns,{name}_compute_ns");
    }
    text.push('\n');
    for cycle in cycles {
        let t_us = (cycle.t_schedule_ns - start_ns) / 1000;
        let _ = write!(text, "{t_us},{}", cycle.end_to_end_ns());
        match cycle.stages {
            Some(stages) => {
                for stage in stages {
                    let _ = write!(text, ",{},{}", stage.hand_over_ns, stage.compute_ns);
                }
            }
            None => text.push_str(",,,,,,,,"),
        }
        text.push('\n');
    }
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(text.as_bytes())?;
    Ok(packed.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycles(latencies_us: &[u64]) -> Vec<Cycle> {
        let cycle = |(k, us): (u64, &u64)| Cycle {
            t_schedule_ns: 5_000_000_000 + k * 400_000_000,
            t_done_ns: 5_000_000_000 + k * 400_000_000 + us * 1000,
            answer_compute_ns: 0,
            stages: None,
        };
        (0..).zip(latencies_us).map(cycle).collect()
    }

    #[test]
    fn the_interval_log_holds_every_cycle_in_its_second() {
        use hdrhistogram::serialization::Deserializer;
        use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
        let log = hlog(
            &cycles(&[100, 200, 300, 400, 500, 600]),
            "end to end",
            |c| Some(c.end_to_end_ns()),
        )
        .unwrap();
        let mut counts = Vec::new();
        for entry in IntervalLogIterator::new(&log) {
            if let LogEntry::Interval(interval) = entry.unwrap() {
                let bytes = interval.encoded_histogram().as_bytes();
                let packed = base64(bytes);
                let found: Histogram<u64> =
                    Deserializer::new().deserialize(&mut &packed[..]).unwrap();
                counts.push((interval.start_timestamp().as_secs(), found.len()));
            }
        }
        assert_eq!(counts, [(0, 3), (1, 2), (2, 1)]);
    }

    #[test]
    fn the_longest_cycles_keep_their_order() {
        let kept = longest(&cycles(&[100, 600, 300, 400, 500, 200]), 3);
        let kept: Vec<u64> = kept.iter().map(|c| c.end_to_end_ns() / 1000).collect();
        assert_eq!(kept, [600, 400, 500]);
    }

    /// Decodes base 64.
    fn base64(text: &[u8]) -> Vec<u8> {
        let digit = |c: u8| match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            _ => 63,
        };
        let groups = text.chunks(4).flat_map(|group| {
            let used = group.iter().filter(|c| **c != b'=').count();
            let bits = group.iter().fold(0_u32, |bits, &c| {
                bits << 6 | u32::from(if c == b'=' { 0 } else { digit(c) })
            });
            bits.to_be_bytes()[1..used].to_vec()
        });
        groups.collect()
    }

    #[test]
    fn the_spectrum_counts_what_is_at_or_below_each_value() {
        let mut latency = Latency::new().unwrap();
        let values: Vec<u64> = (1..=900).map(|_| 50).chain(1..=100).collect();
        values.iter().for_each(|us| latency.record(us * 1000));
        let text = hgrm(&latency);
        let rows: Vec<Vec<&str>> = text
            .lines()
            .skip(2)
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split_ascii_whitespace().collect())
            .collect();
        for row in &rows {
            // A bin is at most a thousandth of its value wide.
            let value: f64 = row[0].parse().unwrap();
            let below = values.iter().filter(|v| **v as f64 <= value * 1.001);
            assert_eq!(row[2], below.count().to_string(), "{row:?}");
        }
        let last = rows.last().unwrap();
        assert_eq!(last[1..], ["1.000000000000", "1000", "inf"]);
        assert!((last[0].parse::<f64>().unwrap() - 100.0).abs() < 0.1);
        assert!(text.contains("TotalCount     =         1000"));
    }
}
