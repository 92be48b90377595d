//! What a window says of a change of several channels at once.

use super::{BLOCKS, Change, Law, Row};
use crate::channel_model::CHANNELS_MAX;
use crate::channel_model::square::{along, by_block, dot, product, sums_from};

/// A change of several channels, where they were measured.
#[derive(Debug, Clone)]
pub struct JointSignature {
    rows: [Row; CHANNELS_MAX],
    /// Along each principal direction.
    along: [Row; CHANNELS_MAX],
}

impl Law {
    /// A change of the channels, by channel.
    #[must_use]
    pub fn signature(&self, rows: &[Row]) -> JointSignature {
        let mut signature = JointSignature {
            rows: [[0.0; BLOCKS]; CHANNELS_MAX],
            along: [[0.0; BLOCKS]; CHANNELS_MAX],
        };
        let slots = signature.rows.iter_mut().zip(rows).zip(&self.read);
        slots.for_each(|((slot, row), read)| *slot = by_block(row, read));
        for (slot, direction) in signature.along.iter_mut().zip(&self.directions) {
            *slot = along(&direction.vector, &signature.rows);
        }
        signature
    }

    /// What a window says of a change of several channels at once, from each block on; `but`: a
    /// channel that does not change.
    #[must_use]
    pub fn joint_change(&self, signature: &JointSignature, but: Option<usize>) -> [Change; BLOCKS] {
        let mut b = [0.0; BLOCKS];
        for (channel, row) in signature.rows.iter().enumerate().take(self.channels) {
            if Some(channel) != but {
                let products = b.iter_mut().zip(by_block(row, &self.gradient[channel]));
                products.for_each(|(sum, product)| *sum += product);
            }
        }
        let left_out = but.map(|channel| (channel, &signature.rows[channel]));
        let mut a = [0.0; BLOCKS];
        let laws = self.directions.iter().zip(&self.lower);
        for ((direction, lower), along) in laws.zip(&signature.along) {
            let along = left_out.map_or(*along, |(channel, row)| {
                let share = direction.vector[channel];
                std::array::from_fn(|block| along[block] - share * row[block])
            });
            let later = a.iter_mut().zip(by_block(&along, &product(lower, &along)));
            later.for_each(|(sum, product)| *sum += 2.0 * product);
        }
        let (b, a) = (sums_from(b), sums_from(a));
        std::array::from_fn(|first| Change {
            b: b[first],
            a: a[first],
        })
    }

    /// Takes out of what the window says of a change what the readings of one channel say.
    pub fn silence(
        &self,
        changes: &mut [Change; BLOCKS],
        signature: &JointSignature,
        silent: usize,
    ) {
        // What each block of the signature is expected to show in the channel.
        let mut shown = [[0.0; BLOCKS]; BLOCKS];
        let laws = self.directions.iter().zip(&self.precision);
        for ((direction, precision), along) in laws.zip(&signature.along) {
            let share = direction.vector[silent];
            for ((shown, row), s) in shown.iter_mut().zip(precision).zip(along) {
                let values = shown.iter_mut().zip(row);
                values.for_each(|(sum, p)| *sum += share * s * p);
            }
        }
        let whitening = &self.own_whitening[silent];
        let gradient = product(whitening, &self.gradient[silent]);
        let mut whole = [0.0; BLOCKS];
        for (change, shown) in changes.iter_mut().zip(shown).rev() {
            let more = whole.iter_mut().zip(shown);
            more.for_each(|(sum, more)| *sum += more);
            let whitened = product(whitening, &whole);
            change.b -= dot(&whitened, &gradient);
            change.a -= dot(&whitened, &whitened);
        }
    }
}
