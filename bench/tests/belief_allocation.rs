//! A belief update allocates nothing, possible observation or not.
#![allow(clippy::unwrap_used)]

use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_decision::{Evidence, Pomdp, Tracker};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn no_belief_update_allocates() {
    let sharp = "discount: 0.9 states: 30 actions: 2 observations: 30\nT: 0 identity T: 1 uniform\n\
        O: 0 uniform O: 1 uniform O: 0 : 3 : * 0 O: 0 : 3 : 7 1 O: * : 4 : * 0 O: * : 4 : 9 1\n";
    // Beyond what is laid out for updates.
    let large = sharp.replace("observations: 30", "observations: 40000");
    for text in [sharp, &large] {
        let model = Pomdp::parse(text).unwrap();
        let mut tracker = Tracker::new(&model);
        let soft: Vec<f64> = (0..30).map(f64::from).collect();
        let nothing = [0.0; 30];
        let (mut taken, mut impossible) = (0, 0);
        let before = allocations();
        assert!(before > 0, "the allocator does not count");
        for step in 0..10_000_usize {
            let (mut action, mut z) = (step / 50 % 2, [9, 7, 1][step % 3]);
            if step % 100 == 0 {
                // State 4 stays, and does not show 7.
                let mut only = [0.0; 30];
                only[4] = 1.0;
                tracker.anchor(&only);
                (action, z) = (0, 7);
            }
            match tracker.update(&model, action, z) {
                Evidence::Taken(_) => taken += 1,
                Evidence::Impossible => impossible += 1,
            }
            tracker.predict(&model, 1 - step % 2);
            tracker.weigh(if step % 7 == 0 { &nothing } else { &soft });
            if step % 1000 == 0 {
                tracker.reset();
            }
        }
        assert_eq!(allocations() - before, 0);
        assert!(taken > 1000 && impossible > 10, "{taken}, {impossible}");
    }
}
