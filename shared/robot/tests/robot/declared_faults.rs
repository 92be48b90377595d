//! What of a declared fault is refused.

use std::collections::BTreeMap;

use vigil_robot::channel_model::component::unfit;
use vigil_robot::channel_model::tree::tree;
use vigil_robot::fault_table::DeclaredFault;

use super::channel_model::robot;

#[test]
fn a_declared_fault_has_a_name_of_its_own_and_shows_in_channels_that_are_there() {
    let declared = |fault: &str| {
        let mut robot = robot("kobuki");
        robot.fault =
            toml::from_str::<BTreeMap<String, Vec<DeclaredFault>>>(fault).unwrap()["fault"].clone();
        (unfit(&robot), tree(&robot))
    };
    let good = "fault = [{ name = 'tyre', group = 'LEFT', shows = ['enc_L', 'current_L'] }]";
    let (refused, made) = declared(good);
    assert_eq!(refused, None);
    let made = made.unwrap();
    let leaf = made.index("tyre").unwrap();
    let group = made.nodes()[leaf].parent.unwrap();
    assert_eq!(made.nodes()[group].name, "LEFT");
    assert_eq!(made.nodes()[leaf].fault.as_deref(), Some("fault:tyre"));
    let (refused, made) = declared("fault = [{ name = 'tyre', wheel = 'R' }]");
    assert_eq!(refused, None);
    let made = made.unwrap();
    let group = made.nodes()[made.index("tyre").unwrap()].parent.unwrap();
    assert_eq!(made.nodes()[group].name, "WHEEL_R");
    for (fault, said) in [
        ("fault = [{ name = 'enc_L' }]", "is taken"),
        ("fault = [{ name = 'a' }, { name = 'a' }]", "is taken"),
        ("fault = [{ name = 'UNKNOWN' }]", "a word of Vigil's own"),
        ("fault = [{ name = 'a', group = 'enc_L' }]", "is taken"),
        ("fault = [{ name = 'a', group = '' }]", "'' is no name"),
        ("fault = [{ name = 'WHEEL_L' }]", "is taken"),
        (
            "fault = [{ name = 'a', shows = ['enc_L', 'enc_L'] }]",
            "'enc_L' twice",
        ),
        ("fault = [{ name = 'flat tyre' }]", "letters, digits"),
        (
            "fault = [{ name = 'tyre', wheel = 'LM' }]",
            "'LM', which is no wheel whose rate",
        ),
        (
            "fault = [{ name = 'tyre', shows = ['enc_X'] }]",
            "'enc_X', which is no channel",
        ),
        (
            "fault = [{ name = 'tyre', shows = ['enc_L', 'enc_R', 'yaw_rate', 'current_L', \
             'current_R'] }]",
            "5 channels: allowed are 4",
        ),
    ] {
        let refused = declared(fault).0.unwrap_or_default();
        assert!(refused.contains(said), "{fault}: {refused}");
    }
    let nine = (0..9).map(|i| format!("{{ name = 'f{i}' }}"));
    let nine = format!("fault = [{}]", nine.collect::<Vec<_>>().join(", "));
    assert!(declared(&nine).0.unwrap().contains("9 faults"));
}
