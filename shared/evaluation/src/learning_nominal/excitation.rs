//! Whether a log shows what a model must know.

use vigil_robot::Description;
use vigil_robot::nominal::Range;

use super::NominalError;
use super::record::Record;
use crate::correlation::correlation;

/// Motion needed, s.
const MOVING_MIN_S: f64 = 10.0;
/// Part of an axis's limit over which its commands must vary.
const WIDTH_MIN: f64 = 0.05;
/// Correlation of two axes from which they count as one.
const TOGETHER: f64 = 0.98;

/// Ranges of the command in motion.
pub(super) fn ranges(records: &[Record], robot: &Description) -> Result<Vec<Range>, NominalError> {
    let found_s: f64 = records.iter().map(Record::moving_s).sum();
    if found_s < MOVING_MIN_S {
        return Err(NominalError::Still {
            found_s,
            needed_s: MOVING_MIN_S,
        });
    }
    let newest = || {
        records
            .iter()
            .flat_map(|r| &r.histories)
            .filter_map(|h| h.ago(0))
    };
    let moving = || newest().filter(|now| now.moving);
    let mut ranges = Vec::with_capacity(robot.command.len());
    for (i, axis) in robot.command.iter().enumerate() {
        let commands = || moving().filter_map(|now| now.command.get(i).copied());
        let (min, max) = (
            commands().fold(f64::INFINITY, f64::min),
            commands().fold(f64::NEG_INFINITY, f64::max),
        );
        let needed = WIDTH_MIN * axis.limit;
        if max - min < needed {
            return Err(NominalError::Unexcited {
                axis: axis.name.clone(),
                unit: axis.unit.clone(),
                min,
                max,
                needed,
            });
        }
        ranges.push(Range {
            name: axis.name.clone(),
            unit: axis.unit.clone(),
            min,
            max,
        });
    }
    for i in 0..ranges.len() {
        for j in 0..i {
            let pairs: Vec<(f64, f64)> = moving()
                .map(|now| (now.command[i], now.command[j]))
                .collect();
            let correlation = correlation(&pairs);
            if correlation.abs() > TOGETHER {
                return Err(NominalError::Together {
                    one: ranges[j].name.clone(),
                    other: ranges[i].name.clone(),
                    correlation,
                });
            }
        }
    }
    Ok(ranges)
}
