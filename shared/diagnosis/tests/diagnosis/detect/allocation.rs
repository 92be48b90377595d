//! A steady cycle of the detector allocates nothing.

use vigil_blocks::{DetectionBelief, Entry, ParticleBlock};
use vigil_cycle::allocation::allocations;
use vigil_diagnosis::detect;
use vigil_diagnosis::detect::{Detector, Form};

use crate::recorded;

#[test]
fn steady_cycles_allocate_nothing() {
    let (frames, _) = recorded::unseen("RM_STUCK", "stuck");
    let (model, robot) = (recorded::model(), recorded::robot());
    for form in [Form::LearnedBias, Form::EDetector] {
        let settings = detect::Settings {
            form,
            ..detect::Settings::default()
        };
        let mut detector = Detector::new(&model, &robot, &settings).unwrap();
        let mut belief = DetectionBelief::default();
        let mut hypotheses: Box<ParticleBlock> = Box::default();
        let before = allocations();
        for frame in &frames {
            detector.step(Entry::Frame(frame), &mut belief, &mut hypotheses);
            detector.step(Entry::Missed(1), &mut belief, &mut hypotheses);
        }
        detector.step(Entry::Reset, &mut belief, &mut hypotheses);
        assert_eq!(allocations() - before, 0, "{form}");
        // It did detect.
        assert_eq!(belief.alarm_count, 1, "{form}");
    }
}
