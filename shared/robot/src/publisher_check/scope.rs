//! How much of a publisher's frames the motion has shown, in words.

use std::ops::Range;

use super::wheels::Group;
use super::{
    AXLES, GYRO, PublisherCheck, SIDES, SIGN, STEER, STEER_ORDER, TESTS, TRAVEL, TURN, TestOutcome,
    UNIT, wheel_of,
};
use crate::description::Kinematics;

/// Tests of one kind, what they are about, and the motion that excites them.
struct TestGroup {
    tests: Range<usize>,
    what: &'static str,
    /// First letters of its channels' names; empty where `what` names the channel.
    channel: &'static str,
    motion: &'static str,
}

const GROUPS: [TestGroup; 9] = [
    TestGroup {
        tests: TRAVEL..TURN,
        what: "travel of the pose",
        channel: "",
        motion: "drive four metres, or a quarter turn",
    },
    TestGroup {
        tests: TURN..GYRO,
        what: "sign and unit of yaw",
        channel: "",
        motion: "drive a left curve and a right one",
    },
    TestGroup {
        tests: GYRO..UNIT,
        what: "sign and unit of yaw_rate",
        channel: "",
        motion: "drive a left curve and a right one",
    },
    TestGroup {
        tests: UNIT..SIGN,
        what: "unit of the wheel rates",
        channel: "",
        motion: "drive straight ahead for a second or two",
    },
    TestGroup {
        tests: SIGN..STEER,
        what: "signs of",
        channel: "enc_",
        motion: "drive straight ahead for a second or two",
    },
    TestGroup {
        tests: STEER..SIDES,
        what: "signs of",
        channel: "steer_",
        motion: "drive a left curve",
    },
    TestGroup {
        tests: SIDES..AXLES,
        what: "sides of",
        channel: "enc_",
        motion: "drive a left curve",
    },
    TestGroup {
        tests: AXLES..STEER_ORDER,
        what: "order on each side of",
        channel: "enc_",
        motion: "drive the tightest curves",
    },
    TestGroup {
        tests: STEER_ORDER..TESTS,
        what: "order of",
        channel: "steer_",
        motion: "drive a tight left curve",
    },
];
/// What wheels that are no rover's need besides: both axes at once.
const ALL_WAYS: &str = "drive forward, and as far to the left";

/// What was judged, and what was not.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Scope {
    /// What fits.
    pub fits: Vec<String>,
    /// What the motion should have shown, and did not: the channel does not follow the command.
    pub unclear: Vec<String>,
    /// What has not been judged, and the motion that would show it.
    pub unjudged: Vec<(String, &'static str)>,
    /// What no commanded motion shows.
    pub unknowable: Vec<String>,
}

impl PublisherCheck {
    /// What has been judged, and what no motion has excited yet: in words, with the motion that
    /// would. What the robot does not have is in neither.
    #[must_use]
    pub fn scope(&self) -> Scope {
        let mut scope = Scope {
            unknowable: self.unknowable(),
            ..Scope::default()
        };
        for group in &GROUPS {
            let (mut fits, mut unclear, mut unjudged) = (Vec::new(), Vec::new(), Vec::new());
            for test in group.tests.clone() {
                let bit = 1 << test;
                if (self.absent | self.wrong) & bit != 0 {
                    continue;
                }
                let list = match self.judge(test) {
                    _ if self.judged & bit != 0 => &mut fits,
                    TestOutcome::Unclear => &mut unclear,
                    _ => &mut unjudged,
                };
                list.push(self.channel_of(group, test));
            }
            let in_words = |channels: &[String]| {
                let text = format!("{} {}", group.what, channels.join(", "));
                (!channels.is_empty()).then(|| text.trim_end().to_owned())
            };
            scope.fits.extend(in_words(&fits));
            scope.unclear.extend(in_words(&unclear));
            let is_omni = self.robot.kinematics == Kinematics::Omni3 && group.tests.start >= SIGN;
            let motion = if is_omni { ALL_WAYS } else { group.motion };
            scope
                .unjudged
                .extend(in_words(&unjudged).map(|what| (what, motion)));
        }
        scope
    }

    fn channel_of(&self, group: &TestGroup, test: usize) -> String {
        if group.channel.is_empty() {
            return String::new();
        }
        let wheel = wheel_of(test).and_then(|wheel| self.robot.wheels.get(wheel));
        format!(
            "{}{}",
            group.channel,
            wheel.map_or("?", |wheel| &wheel.name)
        )
    }

    /// What the command says nothing of.
    fn unknowable(&self) -> Vec<String> {
        let (robot, measured) = (&self.robot, self.robot.measured);
        let mut all = Vec::new();
        if robot.kinematics == Kinematics::None {
            all.push("units, signs and order: the robot has no kinematics".to_owned());
            return all;
        }
        let wheels = 0..self.wheels.wheel_count();
        let alike = |wheel: usize| -> Option<String> {
            let mut others = self.wheels.others(Group::Alike, wheel).peekable();
            if others.peek().is_none_or(|first| *first < wheel) {
                return None;
            }
            let named = |wheel: usize| format!("enc_{}", robot.wheels[wheel].name);
            let names: Vec<String> = std::iter::once(wheel).chain(others).map(named).collect();
            Some(format!("which is which of {}", names.join(", ")))
        };
        if measured.wheel_rates {
            all.extend(wheels.filter_map(alike));
        }
        if robot.kinematics == Kinematics::Omni3 {
            all.push("the sense in which all wheels turn".to_owned());
        }
        if !self.is_turned() && measured.pose {
            all.push("sign and unit of yaw: no axis of the command turns the robot".to_owned());
        }
        if !self.is_turned() && measured.yaw_rate {
            all.push("sign and unit of yaw_rate: no axis of the command turns it".to_owned());
        }
        if measured.currents {
            all.push("units, signs and order of the currents".to_owned());
        }
        if !robot.channel.is_empty() {
            let names: Vec<&str> = robot.channel.iter().map(|c| c.name.as_str()).collect();
            all.push(format!("units and signs of {}", names.join(", ")));
        }
        all
    }
}
