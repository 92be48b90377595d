//! What recording a cycle costs a service, by itself.

use std::error::Error;
use std::time::Instant;

use vigil_cycle::{CycleStamps, Recorder};

const BATCHES: u64 = 201;
const CYCLES: u64 = 1000;

/// Time to record one cycle, ns: three histograms and the stamps; the median of many batches.
///
/// # Errors
/// None in practice; see [`Recorder::new`].
pub fn cycle_ns() -> Result<f64, Box<dyn Error>> {
    let mut recorder = Recorder::new()?.with_stamps(CYCLES as usize);
    let mut batch = |number: u64| {
        let from = Instant::now();
        for k in number * CYCLES..(number + 1) * CYCLES {
            // Latencies as they occur, 20 to 150 us, in no order.
            let took_ns = 20_000 + (k * 7919) % 130_000;
            recorder.timing.wake_up.record(took_ns / 4);
            recorder.timing.from_schedule.record(took_ns);
            std::hint::black_box(recorder.keep(CycleStamps {
                t_schedule_ns: k,
                t_input_ns: k,
                t_wake_ns: k,
                t_publish_ns: k + took_ns / 2,
            }));
        }
        from.elapsed().as_nanos() as f64 / CYCLES as f64
    };
    let mut all: Vec<f64> = (0..BATCHES).map(&mut batch).collect();
    all.sort_unstable_by(f64::total_cmp);
    Ok(all[all.len() / 2])
}
