//! Any document is read or refused; what is read can be written as `.pomdp`, and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use vigil_pomdp::{Pomdp, Tracker};

fuzz_target!(|text: &str| {
    let Ok(model) = Pomdp::parse_pomdpx(text) else {
        return;
    };
    let mut tracker = Tracker::new(&model);
    tracker.update(&model, 0, 0);
    let sum: f64 = tracker.belief().iter().sum();
    assert!((sum - 1.0).abs() < 1e-9);
    // Large models take long to write, and their text is no different.
    let entries = model.states().len() * model.actions().len() * model.observations().len();
    if entries <= 1 << 12 {
        let again = Pomdp::parse(&model.to_cassandra());
        assert!(again.is_ok_and(|again| again == model));
    }
});
