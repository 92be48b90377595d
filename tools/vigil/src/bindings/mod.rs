//! The wire blocks as types of other languages, made from the Rust structs themselves.

mod c;
mod python;

use vigil_blocks::layout::{Field, Layout};
use vigil_blocks::{
    Action, ActionOutcome, Block, CATCHING_UP, Carryover, Cause, CauseKind, ControlMode,
    DetectionBelief, Event, FaultBelief, FaultRecord, FaultSet, Faults, Header, Health,
    HealthyBelief, ParticleBlock, RecoveryKind, SensorFrame, SizeKind, Symptoms, Truth, Verdict,
    WeightedHypothesis,
};

pub use c::header;
pub use python::module;

/// A struct of the wire.
struct Struct {
    name: &'static str,
    fields: &'static [Field],
    size: usize,
    /// Schema and type name of a block; none for a part of blocks.
    block: Option<(u64, &'static str)>,
}

fn part<T: Layout>() -> Struct {
    Struct {
        name: T::NAME,
        fields: T::FIELDS,
        size: size_of::<T>(),
        block: None,
    }
}

fn block<T: Block + Layout>() -> Struct {
    Struct {
        block: Some((T::SCHEMA, T::TYPE_NAME)),
        ..part::<T>()
    }
}

/// Parts before the blocks that hold them.
fn structs() -> Vec<Struct> {
    vec![
        part::<Header>(),
        part::<Cause>(),
        part::<FaultSet>(),
        part::<HealthyBelief>(),
        part::<WeightedHypothesis>(),
        part::<Event>(),
        part::<FaultRecord>(),
        part::<Carryover>(),
        block::<SensorFrame>(),
        block::<DetectionBelief>(),
        block::<ParticleBlock>(),
        block::<FaultBelief>(),
        block::<Action>(),
        block::<Truth>(),
        block::<Faults>(),
        block::<Health>(),
        block::<Verdict>(),
    ]
}

/// Named values of fields: prefix, name, value.
fn constants() -> Vec<(&'static str, String, u64)> {
    let mut all = Vec::new();
    for (name, bit) in Symptoms::NAMED {
        all.push(("SYMPTOM", name.to_owned(), u64::from(bit)));
    }
    let outcomes = [
        ("NONE", ActionOutcome::None),
        ("RUNNING", ActionOutcome::Running),
        ("SUCCEEDED", ActionOutcome::Succeeded),
        ("FAILED", ActionOutcome::Failed),
    ];
    all.extend(outcomes.map(|(name, value)| ("OUTCOME", name.to_owned(), value as u64)));
    let kinds = [
        ("NONE", RecoveryKind::None),
        ("GO_ON", RecoveryKind::GoOn),
        ("SLOW_DOWN", RecoveryKind::SlowDown),
        ("STOP", RecoveryKind::Stop),
        ("COMPENSATE", RecoveryKind::Compensate),
        ("IGNORE_ENCODER", RecoveryKind::IgnoreEncoder),
        ("CALL_FOR_HELP", RecoveryKind::CallForHelp),
        ("NEW_PATH", RecoveryKind::NewPath),
        ("RELOCALISE", RecoveryKind::Relocalise),
        ("GO_THROUGH", RecoveryKind::GoThrough),
        ("MOVE_AWAY", RecoveryKind::MoveAway),
        ("GIVE_UP", RecoveryKind::GiveUp),
        ("OWN", RecoveryKind::Own),
        ("LIMP_HOME", RecoveryKind::LimpHome),
    ];
    all.extend(kinds.map(|(name, value)| ("RECOVERY", name.to_owned(), value as u64)));
    let modes = [
        ("POLICY", ControlMode::Policy),
        ("DUAL", ControlMode::Dual),
        ("FALLBACK", ControlMode::Fallback),
        ("SAFE", ControlMode::Safe),
    ];
    all.extend(modes.map(|(name, value)| ("CONTROL", name.to_owned(), value as u64)));
    let sizes = SizeKind::ALL
        .iter()
        .map(|kind| (format!("{kind:?}"), *kind as u64));
    all.extend(sizes.map(|(name, value)| ("SIZE", upper(&name), value)));
    let causes = [("FRAME", CauseKind::Frame), ("MISSED", CauseKind::Missed)];
    all.extend(causes.map(|(name, value)| ("CAUSE", name.to_owned(), value as u64)));
    let name = "CATCHING_UP".to_owned();
    all.push(("IDENTIFYING", name, u64::from(CATCHING_UP)));
    all
}

/// `BiasRadS` as `BIAS_RAD_S`.
fn upper(name: &str) -> String {
    let mut out = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(letter.to_ascii_uppercase());
    }
    out
}

/// Element type of a field and, of an array, how many of them: `[f64; WHEELS]` is eight `f64`.
fn elements(field: &Field) -> (&'static str, Option<usize>) {
    let Some(inner) = field.type_text.strip_prefix('[') else {
        return (field.type_text, None);
    };
    let element = inner.split(';').next().unwrap_or_default().trim();
    let size = match element {
        "f64" | "u64" | "i64" => 8,
        "u32" | "f32" | "i32" => 4,
        "u16" | "i16" => 2,
        "u8" | "i8" => 1,
        name => {
            let parts = structs();
            let part = parts.iter().find(|s| s.name == name);
            part.map_or(1, |s| s.size)
        }
    };
    (element, Some(field.size / size))
}

/// True for a name: its bytes are letters.
fn is_text(field: &Field) -> bool {
    field.type_text == "[u8; NAME_SIZE]"
}

/// Documentation of a field as one line of plain text.
fn doc(field: &Field) -> String {
    let line = |attribute: &&str| {
        let text = attribute.strip_prefix("doc").unwrap_or(attribute).trim();
        let text = text.strip_prefix('=').unwrap_or(text).trim();
        let text = text.trim_start_matches('r').trim_matches('#');
        text.trim_matches('"').trim().replace("\\\"", "\"")
    };
    let lines: Vec<String> = field.doc.iter().map(line).collect();
    // Links are for Rust's documentation.
    let text = lines.join(" ").replace("[`", "").replace("`]", "");
    text.replace('`', "").replace("crate::", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_and_documentation_are_read_from_the_structs() {
        let field = |name| SensorFrame::FIELDS.iter().find(|f| f.name == name);
        let of = |name| field(name).map(|f| (elements(f), doc(f)));
        let pose = "Planned pose x m, y m, yaw rad, in the frame of the pose's channels.";
        assert_eq!(
            of("planned_pose"),
            Some((("f64", Some(3)), pose.to_owned()))
        );
        let known = "1 if planned_pose is known.".to_owned();
        assert_eq!(of("planned_pose_valid"), Some((("u32", None), known)));
        let events = Health::FIELDS.iter().find(|f| f.name == "events");
        assert_eq!(events.map(elements), Some(("Event", Some(32))));
    }
}
