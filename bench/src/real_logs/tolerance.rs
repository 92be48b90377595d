//! What a healthy robot does differently from its model, by channel.

use std::error::Error;

use vigil_robot::channel_model::law::BLOCKS;
use vigil_robot::channel_model::{Monitor, Observer};
use vigil_robot::learned::channels::Channels;

use super::split::Split;
use crate::quantile;

/// Share of a healthy second's residuals that are within the tolerance.
const WITHIN: f64 = 0.99;

/// Tolerance of each channel, in its unit: of the mean residual of a second in the judged runs.
///
/// # Errors
/// A model without a law.
pub fn tolerances(split: &Split) -> Result<Vec<f64>, Box<dyn Error>> {
    let channels = split.model.channel.len();
    let mut residuals = vec![Vec::new(); channels];
    for run in &split.judged {
        let mut observer = Observer::new(split.robot());
        let mut monitor = Monitor::new(&split.model, split.robot(), Channels::PoseEncoders, 1.0)
            .ok_or("the model has no law")?;
        for frame in &run.frames {
            if !observer.push(frame).complete {
                continue;
            }
            monitor.step(observer.history(), observer.orders());
            if !observer.history().ago(0).is_some_and(|now| now.moving) {
                continue;
            }
            let window = monitor.bank().window();
            for (i, found) in residuals.iter_mut().enumerate() {
                let [older, newer] = [BLOCKS - 2, BLOCKS - 1];
                let unit = window.unit[i][older] + window.unit[i][newer];
                if let (Some(a), Some(b)) = (window.z[i][older], window.z[i][newer])
                    && unit > 0.0
                {
                    found.push(((a + b) / unit).abs());
                }
            }
        }
    }
    let mut tolerances = residuals;
    Ok(tolerances
        .iter_mut()
        .map(|found| quantile(found, WITHIN))
        .collect())
}
