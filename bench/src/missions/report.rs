//! Missions in words and numbers.

use serde_json::{Value, json};

use super::arm::Arm;
use super::drive::Mission;
use super::plan::Kind;
use super::score::MEASURES;
use super::table::{against, differences, figures, means, select};
use super::{HELP_S, LIMIT_S};
use crate::archive::Archive;

/// All figures, by kind of mission.
#[must_use]
pub fn document(missions: &[Mission]) -> Value {
    let mut document = json!({
        "limit_s": LIMIT_S, "help_s": HELP_S, "all": figures(&select(missions, None)),
    });
    for (kind, _) in Kind::SHARES {
        document[kind.name()] = figures(&select(missions, Some(kind)));
    }
    document
}

/// One line of CSV per mission and commander, with a head.
#[must_use]
pub fn lines(missions: &[Mission]) -> String {
    let keys: Vec<&str> = MEASURES.iter().map(|measure| measure.key).collect();
    let mut text = format!("seed,fault,onset_s,commander,{}\n", keys.join(","));
    for mission in missions {
        let fault = mission.plan.fault.as_ref();
        let (spec, onset_s) = fault.map_or(("", -1.0), |f| (f.spec.as_str(), f.onset_s));
        for (arm, score) in Arm::ALL.iter().zip(&mission.scores) {
            let values = MEASURES.map(|measure| format!("{:.4}", (measure.of)(score)));
            text.push_str(&format!(
                "{},{spec},{onset_s:.2},{},{}\n",
                mission.plan.seed,
                arm.name(),
                values.join(",")
            ));
        }
    }
    text
}

/// The report.
pub fn say(archive: &mut Archive, missions: &[Mission], rate_hz: f64) {
    let shares = Kind::SHARES.map(|(kind, percent)| format!("{} {percent} %", kind.name()));
    archive.say(&format!(
        "{} missions of 20 m at {rate_hz} Hz, paths, soils, faults and noise drawn from seeds; \
         every commander drives each of them in the same world. What breaks: {}; onset at 10 to \
         80 % of the planned time. At most {LIMIT_S:.0} s; help comes {HELP_S:.0} s after it was \
         called, mends everything, and the mission goes on. The path is driven open loop: nobody \
         steers back to a path that was left. Reward: `config/rover.pomdp`, per epoch of 0.1 s by \
         the true state and the action; a remedy for the wrong wheel pays no more than going \
         on.\n",
        missions.len(),
        shares.join(", "),
    ));
    archive.say(
        "*escalation*: at an alarm stop and look for 1 s; then do what the most probable \
         explanation of the same identifier asks for (counter-steer, ignore the encoder, creep if \
         nothing explains it); stop and look again when another explanation has been the most \
         probable for 1 s; call for help at the third stop, or after 2 s of creeping. *stop and \
         call*: at an alarm of the detector. *told the fault*: knows it when it begins and takes \
         the best action for the known state.\n",
    );
    let all = select(missions, None);
    archive.say("## All\n");
    means(&all).iter().for_each(|row| archive.say(row));
    archive.say("");
    differences(&all).iter().for_each(|row| archive.say(row));
    for arm in Arm::ALL.into_iter().filter(|arm| *arm != Arm::Vigil) {
        let found = against(&all, arm, MEASURES[0]);
        archive.say(&format!(
            "\nMission reward with Vigil less {}: {:+.1} ± {:.1}, p = {:.1e}.",
            arm.name(),
            found.difference,
            found.half_width,
            found.p
        ));
    }
    for (kind, _) in Kind::SHARES {
        let here = select(missions, Some(kind));
        archive.say(&format!("\n## {} ({} missions)\n", kind.name(), here.len()));
        means(&here).iter().for_each(|row| archive.say(row));
        archive.say("");
        differences(&here).iter().for_each(|row| archive.say(row));
    }
}

/// The commanders that Vigil does not beat on the mission reward with 95 % confidence; the one
/// that is told the fault is none to beat.
#[must_use]
pub fn lost_against(missions: &[Mission]) -> Vec<&'static str> {
    let all = select(missions, None);
    let wins = |arm: &Arm| {
        let found = against(&all, *arm, MEASURES[0]);
        found.difference - found.half_width > 0.0
    };
    let others = [Arm::Without, Arm::Escalation, Arm::StopAndCall];
    let lost = others.into_iter().filter(|arm| !wins(arm));
    lost.map(Arm::name).collect()
}
