//! Sends a command to a service and waits for its answer.

use std::time::{Duration, Instant};

use vigil_blocks::{Control, Health};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Monotonic, Receiver, Sender, Stamp, Topic};
use vigil_terminal::CommandError;

/// Time that a service may take to answer.
const ANSWER_LIMIT: Duration = Duration::from_secs(2);

/// Sends the filled block; whether the service has done it, or `None` if it does not answer.
///
/// # Errors
/// The transport's.
pub fn send(
    graph: &Graph,
    service: ServiceName,
    sender: &mut dyn Sender<Control>,
) -> Result<Option<bool>, CommandError> {
    let mut health = graph
        .receiver(Topic::Health(service))
        .map_err(CommandError::failure)?;
    let (epoch, seq) = (sender.epoch(), sender.next_seq());
    sender
        .send(Stamp::default(), &Monotonic)
        .map_err(CommandError::failure)?;
    Ok(answer(health.as_mut(), epoch, seq))
}

/// Waits for the answer to command (epoch, seq).
fn answer(health: &mut dyn Receiver<Health>, epoch: u64, seq: u64) -> Option<bool> {
    let started = Instant::now();
    while started.elapsed() < ANSWER_LIMIT {
        while let Some(block) = health.take_next() {
            if (block.control_epoch, block.control_seq) == (epoch, seq) {
                return Some(block.control_result == 1);
            }
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}
