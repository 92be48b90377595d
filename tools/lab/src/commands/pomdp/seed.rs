//! Seeds of commands.

use vigil_blocks::fnv1a;

/// The seed of a command's random numbers: another one for each command, though all are given the
/// same `seed`. What is simulated, learned from it and compared must not share its chances: a
/// policy would be tried on the very missions that it was made from.
pub fn of(command: &str, seed: u64) -> u64 {
    fnv1a::hash(fnv1a::hash_u64(fnv1a::BASIS, seed), command.as_bytes())
}

#[test]
fn commands_and_seeds_are_told_apart() {
    let mut all: Vec<u64> = ["simulate", "learn", "compare"]
        .iter()
        .flat_map(|command| (0..100).map(|seed| of(command, seed)))
        .collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), 300);
    assert_eq!(of("learn", 7), of("learn", 7));
}
