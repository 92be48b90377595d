//! The fewest means that tell the most pairs.

/// A means, by its place, and the pairs that it tells and no one before it does.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Cover {
    /// Place of the means.
    pub means: usize,
    /// Places of the pairs.
    pub pairs: Vec<usize>,
}

/// Of the means, which each tell some pairs, the one that tells most, then the one that tells most
/// of the others, and so on; of equals the first. At most `most`.
pub(super) fn cover(tells: &[Vec<bool>], most: usize) -> Vec<Cover> {
    let mut open = vec![true; tells.first().map_or(0, Vec::len)];
    let mut found = Vec::new();
    while found.len() < most {
        let pairs = |means: usize| -> Vec<usize> {
            let told = tells[means].iter().zip(&open).enumerate();
            let told = told.filter(|(_, (tells, open))| **tells && **open);
            told.map(|(pair, _)| pair).collect()
        };
        let all = (0..tells.len()).map(|means| Cover {
            means,
            pairs: pairs(means),
        });
        let best = all.reduce(|a, b| if b.pairs.len() > a.pairs.len() { b } else { a });
        let Some(best) = best.filter(|best| !best.pairs.is_empty()) else {
            break;
        };
        best.pairs.iter().for_each(|&pair| open[pair] = false);
        found.push(best);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_means_that_tells_most_comes_first_and_the_next_tells_what_is_open() {
        let tells = [
            vec![true, false, false, false],
            vec![false, true, true, false],
            vec![true, false, true, false],
        ];
        let expected = [(1, vec![1, 2]), (0, vec![0])];
        let expected = expected.map(|(means, pairs)| Cover { means, pairs });
        assert_eq!(cover(&tells, 9), expected);
        assert_eq!(cover(&tells, 1), expected[..1]);
        assert!(cover(&[], 9).is_empty());
    }
}
