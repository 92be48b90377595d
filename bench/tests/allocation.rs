//! The filters that are measured allocate nothing in a step.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use vigil_bench::naive::Naive;
use vigil_bench::workload::Rover13;
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_inference::lanes::{Event, LaneFilter, Level, PlanarModel};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn ten_thousand_steps_allocate_nothing() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let (rover, observations) = Rover13::read(&data).unwrap();
    let model = PlanarModel::new(&rover.parameters()).unwrap();
    for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
        for share in [1.0, 0.5] {
            let filter = LaneFilter::new(model.clone(), 64, 1).at_level(level);
            let mut filter = filter.unwrap().resampling_below(share);
            let mut events = 0;
            let before = allocations();
            assert!(before > 0, "the allocator does not count");
            for z in observations.iter().cycle().take(10_000) {
                // Each round begins with a jump back: the ways out are taken too.
                events += u32::from(filter.step(z).event >= Some(Event::Redone));
            }
            assert_eq!(allocations() - before, 0);
            assert!(events > 10, "{events}");
        }
    }
    let mut naive = Naive::new(&rover, 64, 1).unwrap();
    let before = allocations();
    for z in observations.iter().cycle().take(1_000) {
        naive.step(z);
    }
    assert_eq!(allocations() - before, 0);
}
