//! Draws from a table of probabilities in constant time: Walker's alias method (1977), set up as by
//! Vose (1991).

use super::vector::LANES;

/// Bits of an entry that hold the share of its column; the alias has the 4 below.
const SHARE_BITS: u32 = 28;

/// One column for each of 16 outcomes: outcome k keeps the share of its column, and gives the rest
/// to another. Entry k is that share in units of 2^-28, times 16, plus the other outcome; a column
/// that keeps everything names itself.
pub(super) fn table(probabilities: &[f64; LANES]) -> [u32; LANES] {
    let total: f64 = probabilities.iter().sum();
    let mut share = probabilities.map(|p| p / total * LANES as f64);
    let mut entries = std::array::from_fn(|k| k as u32);
    let mut open = [true; LANES];
    // Each round closes one column that has too little, with the surplus of the one that has most.
    for _ in 0..LANES {
        let columns = (0..LANES).filter(|&k| open[k]);
        let least = columns
            .clone()
            .min_by(|&a, &b| share[a].total_cmp(&share[b]));
        let most = columns.max_by(|&a, &b| share[a].total_cmp(&share[b]));
        let (Some(least), Some(most)) = (least, most) else {
            break;
        };
        open[least] = false;
        let units = (share[least] * f64::from(1 << SHARE_BITS)).round();
        if least != most && units < f64::from(1 << SHARE_BITS) {
            entries[least] = ((units.max(0.0) as u32) << 4) | most as u32;
            share[most] -= 1.0 - share[least];
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The probabilities that a table stands for.
    fn read(entries: &[u32; LANES]) -> [f64; LANES] {
        let mut found = [0.0; LANES];
        for (k, entry) in entries.iter().enumerate() {
            let share = f64::from(entry >> 4) / f64::from(1 << SHARE_BITS);
            let alias = (entry & 15) as usize;
            let kept = if alias == k { 1.0 } else { share };
            found[k] += kept / LANES as f64;
            found[alias] += (1.0 - kept) / LANES as f64;
        }
        found
    }

    #[test]
    fn what_is_impossible_stays_impossible() {
        let mut probabilities = [0.0; LANES];
        probabilities[3] = 1.0;
        assert_eq!(read(&table(&probabilities)), probabilities);
        probabilities[3] = 0.75;
        probabilities[15] = 0.25;
        assert_eq!(read(&table(&probabilities)), probabilities);
    }

    proptest! {
        #[test]
        fn tables_stand_for_their_probabilities(
            weights in prop::array::uniform16(prop_oneof![Just(0.0), 1e-9..1e-6, 0.0..1.0f64]),
            sure in 0..LANES,
        ) {
            let mut weights = weights;
            weights[sure] += 0.1;
            let total: f64 = weights.iter().sum();
            for (found, weight) in read(&table(&weights)).iter().zip(weights) {
                prop_assert!((found - weight / total).abs() < 4e-9, "{found} {weight}");
                prop_assert!(weight > 0.0 || *found == 0.0);
            }
        }
    }
}
