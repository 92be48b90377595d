//! The text and the numbers of faults and disturbances.

use vigil_blocks::Event;
use vigil_robot::disturbance::Disturbance;
use vigil_robot::disturbance_kind::{KINDS, Place};
use vigil_robot::injection::{Change, WireChange, forms};
use vigil_robot::{Description, DisturbanceKind, Injection};

use crate::rover;

/// A rover of which only the first two wheels are left.
fn rover() -> Description {
    let mut robot = rover::rover();
    robot.wheels.truncate(2);
    robot
}

fn parse(text: &str) -> Result<Change, String> {
    Injection::parse_change(text, &rover()).map_err(|e| e.to_string())
}

/// One specification of every kind, with defaults.
fn every_kind() -> Vec<String> {
    let specs = KINDS.iter().map(|row| match row.place {
        Place::Rover => row.name.to_owned(),
        Place::Wheel | Place::SteeredWheel => format!("{}:LF", row.name),
        Place::Side => format!("{}:right", row.name),
    });
    specs.collect()
}

#[test]
fn every_change_survives_text_wire_and_event() {
    let mut specs = every_kind();
    assert_eq!(specs.len(), KINDS.len());
    let cleared: Vec<String> = specs.iter().map(|spec| format!("clear:{spec}")).collect();
    specs.extend(cleared);
    specs.extend(KINDS.iter().map(|row| format!("clear:{}", row.name)));
    for spec in ["stuck:LM", "encoder:LF:frozen", "clear:LM", "clear:all"] {
        specs.push(spec.to_owned());
    }
    specs.push("payload-shift:-0.031:0.07".to_owned());
    for spec in specs {
        let change = parse(&spec).unwrap();
        assert_eq!(parse(&change.text(&rover())), Ok(change), "{spec}");
        let wire = change.to_wire();
        assert_eq!(Change::from_wire(&wire), Some(change), "{spec}");
        let (what, p, value) = wire.event();
        let event = Event {
            what,
            p,
            value,
            ..Event::default()
        };
        let told = WireChange::from_event(wire.injects, &event);
        assert_eq!(Change::from_wire(&told), Some(change), "{spec}");
    }
}

#[test]
fn kinds_stand_in_the_order_of_their_codes() {
    for (index, row) in KINDS.iter().enumerate() {
        assert_eq!(row.kind.index(), index);
        assert_eq!(DisturbanceKind::from_wire(row.kind as u32), Some(row.kind));
        assert_eq!(DisturbanceKind::named(row.name), Some(row.kind));
    }
    assert_eq!(DisturbanceKind::from_wire(100), None);
    assert_eq!(DisturbanceKind::from_wire(131), None);
}

#[test]
fn a_disturbance_has_the_values_given_and_defaults_for_the_rest() {
    let expected = |kind, place, parameter| {
        Ok(Change::Disturb(Disturbance {
            kind,
            place,
            parameter,
        }))
    };
    let kind = DisturbanceKind::Brush;
    assert_eq!(parse("brush:LM:12.5"), expected(kind, 1, [12.5, 0.0]));
    assert_eq!(parse("brush:LM"), expected(kind, 1, [20.0, 0.0]));
    let kind = DisturbanceKind::PayloadShift;
    assert_eq!(parse("payload-shift:0.02"), expected(kind, 0, [0.02, 0.1]));
    let kind = DisturbanceKind::SoilSoft;
    assert_eq!(parse("soil-soft:right"), expected(kind, 1, [0.4, 0.0]));
}

#[test]
fn what_is_wrong_is_named_with_what_is_allowed() {
    for (spec, expected) in [
        ("tether:81", "tether: N is 81: allowed is 0 to 80"),
        ("tether:nan", "tether: N is NaN: allowed is 0 to 80"),
        (
            "tether:strong",
            "'tether:strong' does not have the form tether[:N]",
        ),
        (
            "tether:1:2",
            "'tether:1:2' does not have the form tether[:N]",
        ),
        ("brush", "'brush' does not have the form brush:WHEEL[:N]"),
        (
            "brush:XX",
            "'XX' is not a wheel of rover: expected one of LF LM",
        ),
        (
            "steer-jump:LM",
            "wheel LM of rover has no steering servo: expected one of LF",
        ),
        (
            "soil-soft:top",
            "'top' is not a side: expected left or right",
        ),
        (
            "payload-shift:1",
            "payload-shift: M_FORWARD is 1: allowed is -0.1 to 0.1",
        ),
        (
            "clear:tether:LF",
            "'tether:LF' does not have the form tether[:N]",
        ),
        (
            "clear:XX",
            "'XX' is not a wheel of rover: expected one of LF LM",
        ),
    ] {
        assert_eq!(parse(spec).unwrap_err(), expected);
    }
    let unknown = parse("gremlin:3").unwrap_err();
    assert!(
        unknown.starts_with("'gremlin:3' is no fault or disturbance; `vigil inject --list`"),
        "{unknown}"
    );
    for row in &KINDS {
        let listed = forms().into_iter().find(|[form, _]| *form == row.form());
        let [_, meaning] = listed.unwrap_or_else(|| panic!("{} is not listed", row.name));
        assert!(meaning.len() > " Default: 1.".len() + 10, "{meaning}");
    }
}
