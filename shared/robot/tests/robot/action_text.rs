//! Actions in words: the wheels that they are about.

use vigil_blocks::AnsweredWheels;

use crate::rover;

#[test]
fn wheels_stand_after_the_action_and_broken_encoders_are_marked_beside_stuck_wheels() {
    let robot = rover::rover();
    let [lf, rm] = ["LF", "RM"].map(|name| {
        let mut wheels = robot.wheels.iter();
        wheels.position(|wheel| wheel.name == name).unwrap()
    });
    let (stuck, encoder) = (AnsweredWheels::one_stuck, AnsweredWheels::one_encoder);
    for (action, wheels, expected) in [
        ("go_on", AnsweredWheels::default(), "go_on"),
        ("compensate", stuck(rm), "compensate:RM"),
        ("ignore_encoder", encoder(lf), "ignore_encoder:LF"),
        ("limp_home", stuck(lf).with(stuck(rm)), "limp_home:LF+RM"),
        (
            "limp_home",
            encoder(lf).with(stuck(rm)).with(encoder(rm)),
            "limp_home:LF_ENC+RM",
        ),
    ] {
        assert_eq!(robot.action_text(action, wheels), expected);
    }
}
