//! Corridors: straight ones, and such that lead round a block, so that there is another way.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vigil_setup::graph_file::Navigation;

/// Half of a corridor's width, m.
pub(super) const HALF_M: f64 = 1.2;
/// Length of a straight corridor, and of the first leg of one with a corner, m.
const STRAIGHT_M: std::ops::Range<f64> = 8.0..12.0;
const LEG_M: std::ops::Range<f64> = 6.4..9.0;
/// Length of the second leg beyond a corridor's width, m: there lies the corridor that is the other
/// way.
const BEYOND_M: std::ops::Range<f64> = 0.2..1.6;
/// Width of the block between the other way, which turns off first, and the first way, m.
const BLOCK_M: f64 = 0.1;
/// Share of corridors that lead round a block.
const WITH_ALTERNATIVE: f64 = 0.5;

/// A corridor without exceptions.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Paths and walls.
    pub navigation: Navigation,
    /// Half of its width, m.
    pub half_m: f64,
    /// Length of its first leg, m.
    pub leg_m: f64,
    /// True if another way leads to the goal.
    pub has_alternative: bool,
}

impl Layout {
    /// One with the settings of `shipped`, `half_m` on each side of its middle.
    pub(super) fn drawn(shipped: &Navigation, half_m: f64, rng: &mut Pcg64Mcg) -> Self {
        let bare = Navigation {
            obstacle: Vec::new(),
            trouble: Vec::new(),
            alternative: Vec::new(),
            help_s: super::HELP_S,
            ..shipped.clone()
        };
        match rng.random_bool(WITH_ALTERNATIVE) {
            true => Self::round_a_block(bare, half_m, rng),
            false => Self::straight(bare, half_m, rng),
        }
    }

    fn straight(bare: Navigation, half_m: f64, rng: &mut Pcg64Mcg) -> Self {
        let leg_m = rng.random_range(STRAIGHT_M);
        let wall = |y: f64| [-1.0, y, leg_m + 2.0, y];
        Self {
            navigation: Navigation {
                path: vec![[0.0, 0.0], [leg_m, 0.0]],
                walls: vec![wall(-half_m), wall(half_m)],
                ..bare
            },
            half_m,
            leg_m,
            has_alternative: false,
        }
    }

    /// The first way turns at the end of its leg, the other one before it.
    fn round_a_block(bare: Navigation, half_m: f64, rng: &mut Pcg64Mcg) -> Self {
        let leg_m = rng.random_range(LEG_M);
        let side_m = 2.0 * half_m + rng.random_range(BEYOND_M);
        let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let turn_m = leg_m - 2.0 * half_m - BLOCK_M;
        let (right_m, left_m) = (leg_m + half_m, turn_m - half_m);
        // The block between both ways, its corners `half_m` from each.
        let block = [turn_m + half_m, half_m, leg_m - half_m, side_m - half_m];
        let [x0, y0, x1, y1] = block;
        let walls = [
            [-1.0, -half_m, right_m, -half_m],
            [right_m, -half_m, right_m, side_m + half_m],
            [right_m, side_m + half_m, left_m, side_m + half_m],
            [left_m, side_m + half_m, left_m, half_m],
            [left_m, half_m, -1.0, half_m],
            [x0, y0, x1, y0],
            [x1, y0, x1, y1],
            [x1, y1, x0, y1],
            [x0, y1, x0, y0],
        ];
        let mirrored = |[x, y]: [f64; 2]| [x, side * y];
        Self {
            navigation: Navigation {
                path: [[0.0, 0.0], [leg_m, 0.0], [leg_m, side_m]]
                    .map(mirrored)
                    .to_vec(),
                alternative: [[0.0, 0.0], [turn_m, 0.0], [turn_m, side_m], [leg_m, side_m]]
                    .map(mirrored)
                    .to_vec(),
                walls: walls
                    .map(|[a, b, c, d]| [a, side * b, c, side * d])
                    .to_vec(),
                // It must see what blocks before it is past the other way's corner.
                stop_m: 1.5,
                slow_m: 3.2,
                ..bare
            },
            half_m,
            leg_m,
            has_alternative: true,
        }
    }
}
