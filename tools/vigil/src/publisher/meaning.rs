//! Units, signs and order, from what the frames say about each other: the tests that run in the
//! graph, and what would mend all that they find at once.

use vigil_blocks::SensorFrame;
use vigil_robot::Description;
use vigil_robot::publisher_check::{Finding as Meaning, FindingKind, PublisherCheck, Scope};

use super::FrameArrival;
use crate::findings::{Finding, Status};

/// Findings that one mistake in the command must explain; one alone is a channel's.
const EXPLAINED_MIN: usize = 2;

/// What the tests say of frames.
#[derive(Debug, Clone, Default)]
struct Outcome {
    found: Vec<Meaning>,
    scope: Scope,
}

impl Outcome {
    /// Of frames that were changed before.
    fn changed(
        robot: &Description,
        frames: &[FrameArrival],
        change: impl Fn(&mut SensorFrame),
    ) -> Self {
        let mut check = PublisherCheck::new(robot);
        let changed = frames.iter().map(|arrived| {
            let mut frame = arrived.frame;
            change(&mut frame);
            frame
        });
        let found = changed.filter_map(|frame| check.take(&frame)).collect();
        let scope = check.scope();
        Self { found, scope }
    }

    fn doubts(&self) -> usize {
        self.found.len() + self.scope.unclear.len()
    }
}

/// What fits, what does not, and what nothing has shown.
pub fn findings(robot: &Description, frames: &[FrameArrival]) -> Vec<Finding> {
    let as_sent = Outcome::changed(robot, frames, |_| ());
    let finding = |status| move |detail| Finding::new("meaning", status, detail);
    let (texts, scope) = match mended(robot, frames, &as_sent) {
        Some((text, after)) => (
            vec![text],
            Scope {
                fits: Vec::new(),
                ..after.scope
            },
        ),
        None => (texts(robot, &as_sent.found), as_sent.scope),
    };
    let mut all: Vec<Finding> = texts.into_iter().map(finding(Status::Failure)).collect();
    if !scope.fits.is_empty() {
        let detail = format!("the motion fits the command: {}", scope.fits.join("; "));
        all.push(finding(Status::Ok)(detail));
    }
    let unclear = scope.unclear.iter().map(|what| {
        format!(
            "{what}: does not follow the command: does it stand still, or a wheel, or is it \
             another channel?"
        )
    });
    all.extend(unclear.map(finding(Status::Warning)));
    let lacking = scope.unjudged.iter();
    let lacking = lacking
        .map(|(what, motion)| format!("not judged yet: {what}; {motion} while this listens"));
    let unknowable = scope.unknowable.iter();
    let unknowable = unknowable.map(|what| format!("no commanded motion shows: {what}"));
    all.extend(lacking.chain(unknowable).map(finding(Status::Unjudged)));
    all
}

/// Findings in words. A yaw of another unit or sign puts the direction of travel in doubt too.
fn texts(robot: &Description, found: &[Meaning]) -> Vec<String> {
    let has_turn = found
        .iter()
        .any(|finding| finding.kind == FindingKind::Turn);
    let told = found.iter();
    let told = told.filter(|finding| !has_turn || finding.kind != FindingKind::Heading);
    told.map(|finding| finding.text(robot)).collect()
}

/// The one change of the command after which everything fits, in words, and what is said then.
fn mended(
    robot: &Description,
    frames: &[FrameArrival],
    as_sent: &Outcome,
) -> Option<(String, Outcome)> {
    if as_sent.doubts() < EXPLAINED_MIN {
        return None;
    }
    let axes = &robot.command;
    let fits = |outcome: &Outcome| {
        outcome.doubts() == 0 && outcome.scope.fits.len() > as_sent.scope.fits.len()
    };
    for (i, axis) in axes.iter().enumerate() {
        let after = Outcome::changed(robot, frames, |frame| frame.command[i] = -frame.command[i]);
        if fits(&after) {
            let text = format!("signs: all fits when {} has the other sign", axis.name);
            return Some((text, after));
        }
        for (j, other) in axes.iter().enumerate().skip(i + 1) {
            let after = Outcome::changed(robot, frames, |frame| frame.command.swap(i, j));
            if fits(&after) {
                let names = [&axis.name, &other.name].map(String::as_str).join(" and ");
                return Some((format!("axes: all fits when {names} are exchanged"), after));
            }
        }
    }
    None
}
