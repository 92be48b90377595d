use super::*;

const TRAVEL_M: f64 = 0.01;
const NOISE: [f64; 2] = [4e-5, 4e-5];

/// What is declared of a step: a bound of the turn, rad, of the travel ahead and across, m.
fn declared(pose: [f64; 3], curvature: f64, most: [f64; 3]) -> PoseStep {
    PoseStep {
        pose,
        moved: [curvature * TRAVEL_M, TRAVEL_M, 0.0],
        moved_max: most,
        moved_variance: [0.0; 3],
        noise_variance: NOISE,
        elapsed_h: 1.0,
    }
}

/// Drives without noise, but for the heading of the first reading, a context of so much of each
/// bound; the largest of what each axis has of the time that has passed.
fn drive(curvature: f64, of_bound: [f64; 3], first_heading_rad: f64) -> [f64; 3] {
    let most = [2e-4, 8e-4, 4e-4];
    let mut blocks = PoseBlocks::new(0.0);
    let (mut pose, mut largest) = ([0.3, -0.2, 2.0_f64], [0.0_f64; 3]);
    for k in 0..200_u32 {
        let mut read = pose;
        if k == 0 {
            read[2] += first_heading_rad;
        }
        blocks.step(&declared(read, curvature, most));
        for block in &blocks.blocks {
            for (largest, path) in largest.iter_mut().zip(&block.paths) {
                *largest = largest.max(path.hours() / f64::from(k + 1));
            }
        }
        let turn = curvature * TRAVEL_M + of_bound[0] * most[0];
        let (ahead, across) = (TRAVEL_M + of_bound[1] * most[1], of_bound[2] * most[2]);
        let (sin, cos) = (pose[2] + 0.5 * turn).sin_cos();
        pose[0] += cos * ahead - sin * across;
        pose[1] += sin * ahead + cos * across;
        pose[2] = wrap(pose[2] + turn);
    }
    largest
}

#[test]
fn no_trajectory_within_the_bounds_speaks_for_a_fault() {
    for curvature in [-1.0, 0.0, 0.7] {
        for corner in 0..8_u32 {
            let of = [0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 });
            // Without noise no E-value exceeds 1, and no sum the time.
            let all = drive(curvature, of, 0.0);
            assert!(all.iter().all(|of_time| *of_time < 1.0), "{of:?}: {all:?}");
            // A first heading that is read wrongly, by as much as is declared, turns the travel.
            let wrong = of[0] * BOUND * NOISE[0].sqrt();
            let [_, forward, lateral] = drive(curvature, of, wrong);
            assert!(
                forward < 1.0 && lateral < 1.0,
                "{of:?}: {forward} {lateral}"
            );
        }
    }
}

#[test]
fn each_axis_shows_what_goes_beyond_its_bound() {
    for axis in 0..3 {
        let mut of = [0.0; 3];
        of[axis] = 12.0;
        let all = drive(0.0, of, 0.0);
        assert!(all[axis] > 1e6, "{axis}: {all:?}");
    }
}

#[test]
fn some_block_ends_within_half_a_second_and_most_are_under_way() {
    let mut blocks = PoseBlocks::new(0.1);
    let mut since = 0;
    for k in 0..400_u32 {
        blocks.step(&declared([0.0; 3], 0.0, [1.0; 3]));
        let ended = blocks
            .blocks
            .iter()
            .filter(|block| block.paths[0].is_idle());
        since = if ended.count() > 0 { 0 } else { since + 1 };
        assert!(k < 41 || since < 10, "{k}");
    }
    let waiting = blocks.blocks.iter().filter(|block| block.wait > 0);
    assert_eq!(waiting.count(), 0);
    blocks.abandon();
    assert_eq!((blocks.hours(), blocks.vouched_hours()), (0.0, 0.0));
}
