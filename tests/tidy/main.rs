//! Tidy checks: what the project demands of its own text.
//!
//! Each check is a pure function from sources to a list of violations, run once on the whole
//! workspace and once on a bad sample that it must refuse. No dependency: the checks read text,
//! with comments and literals masked, and match braces; they know no more Rust than that.

#![cfg(test)]

mod arrows;
mod bans;
mod config_keys;
mod functions;
mod manifest;
mod mask;
mod names;
mod sizes;
mod source;
mod step_code;
mod struct_fields;
mod test_regions;
mod unsafety;
mod vocabulary;
mod words;

/// Fails with all `violations`, one a line, under the sentence that says what to do.
fn demand_none(advice: &str, violations: &[String]) {
    assert!(
        violations.is_empty(),
        "\n{advice}\n{} violation(s):\n  {}\n",
        violations.len(),
        violations.join("\n  ")
    );
}
