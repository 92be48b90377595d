//! Seeds of commands.

use vigil_blocks::fnv1a;

/// The seed of a command's random numbers: another one for each command, though all are given the
/// same `seed`. What is simulated, learned from it and compared must not share its chances: a
/// policy would be tried on the very missions that it was made from.
pub fn for_command(command: &str, seed: u64) -> u64 {
    fnv1a::hash(fnv1a::hash_u64(fnv1a::BASIS, seed), command.as_bytes())
}

#[test]
fn commands_and_seeds_are_told_apart() {
    let mut all: Vec<u64> = ["simulate", "learn", "compare"]
        .iter()
        .flat_map(|command| (0..100).map(|seed| for_command(command, seed)))
        .collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), 300);
    assert_eq!(for_command("learn", 7), for_command("learn", 7));
}
