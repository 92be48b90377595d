//! Corridors, monitors and what the supervisor needs for them: what does not fit is named.

use crate::shipped::load;
use vigil_decision::{Counts, Evidence, OwnSymptom};
use vigil_diagnosis::detect::MonitorSettings;
use vigil_setup::graph_file::{GraphFile, Source};

#[test]
fn the_shipped_corridors_are_sound() {
    for name in ["corridor-obstacle.toml", "corridor-people.toml"] {
        assert_eq!(load(name, |_| ()), Ok(()));
    }
}

#[test]
fn a_corridor_that_cannot_be_is_refused_by_key() {
    let refused = |change: fn(&mut GraphFile), key: &str, what: &str| {
        let message = load("corridor-people.toml", change).unwrap_err();
        assert!(message.contains(&format!(": {key}: ")), "{key}: {message}");
        assert!(message.contains(what), "{what}: {message}");
    };
    macro_rules! with {
        ($($change:tt)*) => {
            |file: &mut GraphFile| file.navigation.as_mut().unwrap().$($change)*
        };
    }
    refused(
        with!(path.truncate(1)),
        "navigation.path",
        "1 entries: allowed are 2 to 256",
    );
    refused(
        with!(path[0][1] = 0.1),
        "navigation.path",
        "must begin at [0.0, 0.0]",
    );
    refused(
        with!(path[1][0] = f64::NAN),
        "navigation.path.1.0",
        "NaN is out of range: allowed is -1000 to 1000",
    );
    refused(
        with!(path.push([7.0, 0.0])),
        "navigation.path",
        "follows upon itself",
    );
    refused(
        with!(speed_m_s = 0.6),
        "navigation.speed_m_s",
        "allowed is up to 0.5, the robot's limit",
    );
    refused(
        with!(slow_m = 0.9),
        "navigation.slow_m",
        "allowed is 1 or more, stop_m + 0.1",
    );
    refused(with!(look_s = 0.0), "navigation.look_s", "0.1 to 60");
    refused(
        with!(obstacle[1].radius_m = -1.0),
        "navigation.obstacle.1.radius_m",
        "0.01 to 20",
    );
    refused(
        with!(obstacle[2].from_s = 20.0),
        "navigation.obstacle.2.until_s",
        "14 is out of range: allowed is 20 or more",
    );
    let drives = |file: &mut GraphFile| {
        file.drive.push(vigil_setup::graph_file::DriveSegment {
            duration_s: 1.0,
            curvature_1_m: 0.0,
            speed_m_s: 0.1,
        });
    };
    refused(drives, "drive", "leave one out");
    let external = |file: &mut GraphFile| file.sensor.source = Source::External;
    refused(external, "navigation", "sensor.source");
    let spins = |file: &mut GraphFile| file.monitors.as_mut().unwrap().loop_travel_m = 0.5;
    refused(
        spins,
        "monitors.loop_travel_m",
        "0.6 or more, twice loop_radius_m",
    );
}

#[test]
fn evidence_and_actions_that_nothing_gives_are_refused() {
    let name = "corridor-people.toml";
    let message = load(name, |file| file.monitors = None).unwrap_err();
    assert!(message.contains("supervisor.evidence: ") && message.contains("[monitors]"));
    let message = load(name, |file| file.supervisor.evidence = Evidence::Faults).unwrap_err();
    assert!(message.contains("supervisor.lost_state: "), "{message}");
    let message = load(name, |file| file.navigation = None).unwrap_err();
    assert!(message.contains("drive: ") && message.contains("supervisor.actions.NP.kind: "));
    // A robot outside reports symptoms of its own and finds its own paths.
    let external = |file: &mut GraphFile| {
        (file.navigation, file.monitors) = (None, None);
        file.sensor.source = Source::External;
    };
    assert_eq!(load(name, external), Ok(()));
    assert_eq!(
        load("rover.toml", |file| file.monitors =
            Some(MonitorSettings::default())),
        Ok(())
    );
}

#[test]
fn epochs_fit_what_a_robot_does_in_them() {
    let name = "corridor-people.toml";
    let message = load(name, |file| file.supervisor.epoch_ms = 100.0).unwrap_err();
    assert!(
        message.contains("supervisor.epoch_ms: 100 is out of range"),
        "{message}"
    );
    assert!(message.contains("1000 or more"), "{message}");
    let left_out = |file: &mut GraphFile| {
        file.supervisor.epoch_ms = vigil_decision::Settings::default().epoch_ms;
    };
    assert!(load(name, left_out).is_err(), "the default is for faults");
    // Looking takes 6 s, going through 12.
    let limited = |action_max_s| load(name, |file| file.supervisor.action_max_s = action_max_s);
    let message = limited(17.0).unwrap_err();
    assert!(
        message.contains("supervisor.action_max_s: 17 is too short"),
        "{message}"
    );
    assert!(message.contains("may run for 18"), "{message}");
    assert_eq!(limited(18.0), Ok(()));
    // Waiting for help has no limit.
    let waits = |file: &mut GraphFile| file.navigation.as_mut().unwrap().help_s = 600.0;
    assert_eq!(load(name, waits), Ok(()));
}

#[test]
fn symptoms_of_ones_own_have_names_and_bits_of_their_own() {
    let refused = |name: &'static str, bit| {
        let own = |bit| OwnSymptom {
            bit,
            counts: Counts::Rising,
        };
        let change = |file: &mut GraphFile| {
            let symptoms = &mut file.supervisor.symptoms;
            symptoms.insert("DOOR".to_owned(), own(8));
            symptoms.insert(name.to_owned(), own(bit));
        };
        load("corridor-people.toml", change).unwrap_err()
    };
    for (name, bit, part) in [
        ("EPM", 9, "EPM: is no name for a symptom"),
        ("none", 9, "none: is no name for a symptom"),
        ("BACK_DOOR", 9, "BACK_DOOR: is no name for a symptom"),
        ("WINDOW", 8, "WINDOW: has the bit 8 of 'DOOR'"),
        ("WINDOW", 7, "supervisor.symptoms.WINDOW.bit"),
        ("WINDOW", 32, "supervisor.symptoms.WINDOW.bit"),
    ] {
        let message = refused(name, bit);
        assert!(message.contains(part), "{part}: {message}");
    }
}
