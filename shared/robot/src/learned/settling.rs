//! Whether a pose that has begun anew has settled.
//!
//! Of two poses that disagree either may be the outlier. So after a gap or a jump none is evidence
//! until some in a row agree, and one that does not agree begins anew.

use vigil_checkpoint::CheckpointValue;

/// Poses in a row that must agree. Chosen: with fewer, two outliers may agree by chance; with more,
/// the pose is no evidence for longer.
const SETTLES: u32 = 3;
/// Poses after which it has settled whether or not they agree: what never does is no outlier. Half
/// a second of 50 ms.
const SETTLING_MAX: u32 = 10;

/// Poses since it began anew; settled by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, CheckpointValue)]
pub(super) struct Settling(Option<Poses>);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, CheckpointValue)]
struct Poses {
    seen: u32,
    /// So many of the last of them agree.
    agree: u32,
}

impl Settling {
    /// The pose begins anew.
    pub(super) fn begin(&mut self) {
        self.0 = Some(Poses::default());
    }

    /// True once a pose is evidence.
    pub(super) const fn is_over(self) -> bool {
        self.0.is_none()
    }

    /// Takes a pose, which agrees with those before or does not; true if the track may take it,
    /// false if it begins anew with it.
    pub(super) fn take(&mut self, agrees: bool) -> bool {
        let Some(Poses { seen, agree }) = self.0 else {
            return true;
        };
        let (seen, agree) = (seen + 1, if agrees { agree + 1 } else { 0 });
        let is_over = agree >= SETTLES || seen >= SETTLING_MAX;
        self.0 = (!is_over).then_some(Poses { seen, agree });
        agrees || is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_settles_once_three_in_a_row_agree_or_none_do_for_long() {
        let mut settling = Settling::default();
        assert!(settling.is_over() && settling.take(false));
        settling.begin();
        for (agrees, is_over) in [(true, false), (false, false), (true, false), (true, false)] {
            assert_eq!(settling.take(agrees), agrees);
            assert_eq!(settling.is_over(), is_over);
        }
        assert!(settling.take(true) && settling.is_over());
        settling.begin();
        let begun_anew = (0..20).filter(|_| !settling.take(false)).count();
        assert!(settling.is_over() && begun_anew == 9);
    }
}
