//! Violations that stand from before a check: their number may only fall.

use std::collections::BTreeMap;

/// By check and crate, how many there may be.
const KNOWN: &str = include_str!("ratchet.toml");

/// The crate of a violation, `shared/robot` of `shared/robot/src/slip.rs:3: ...`.
fn crate_of(violation: &str) -> &str {
    let end = violation.find("/src").or_else(|| violation.find('/'));
    &violation[..end.unwrap_or(violation.len())]
}

/// Fails where a crate has more violations of a check than are known.
pub fn demand_no_more(check: &str, advice: &str, violations: &[String]) {
    let known: BTreeMap<String, BTreeMap<String, usize>> = toml::from_str(KNOWN).unwrap();
    let mut crates: BTreeMap<&str, Vec<&String>> = BTreeMap::new();
    for violation in violations {
        crates
            .entry(crate_of(violation))
            .or_default()
            .push(violation);
    }
    let more = crates.into_iter().filter_map(|(name, all)| {
        let most = known[check].get(name).copied().unwrap_or(0);
        let list = all
            .iter()
            .map(|one| format!("\n    {one}"))
            .collect::<String>();
        (all.len() > most).then(|| format!("{name}: {} instead of {most}:{list}", all.len()))
    });
    crate::demand_none(advice, &more.collect::<Vec<String>>());
}
