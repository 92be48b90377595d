//! Ground that is another than the one learned on, and changes under way.

use rand::Rng;
use rand_pcg::Pcg64Mcg;
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil};
use vigil_robot::{Description, Disturbance, DisturbanceKind, Tolerance};
use vigil_sensor_sim::{World as Simulated, WorldError};
use vigil_setup::graph_file::Simulator;

use super::scenario::{Draw, World};

/// Shortest way over which a ground changes, m: a step is a scenario of its own.
const OVER_MIN_M: f64 = 0.5;

/// What a wheel stands on: friction, shear modulus, slope ahead and to the side, rad.
type Place = [f64; 4];

/// Speed at which a robot's motion on a ground is judged, m/s: slip hardly depends on it.
const SPEED_M_S: f64 = 0.2;
/// Grounds drawn until one is within the tolerance, at most.
const DRAWS_MAX: usize = 1000;

/// Grounds on which a robot moves as its tolerance allows.
#[derive(Debug, Clone)]
struct Within {
    model: SlipModel,
    tolerance: Tolerance,
    usual: Place,
    curvatures_1_m: [f64; 5],
}

impl Within {
    fn new(robot: &Description, usual: Place, curvature_max_1_m: f64) -> Option<Self> {
        Some(Self {
            model: SlipModel::new(robot).ok()?,
            tolerance: robot.tolerance?,
            usual,
            curvatures_1_m: [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| share * curvature_max_1_m),
        })
    }

    /// Yaw, forward and lateral displacement per metre in a turn.
    fn per_metre(&self, place: Place, curvature_1_m: f64) -> Option<[f64; 3]> {
        let [friction, shear_modulus, slope_rad, side_slope_rad] = place;
        let situation = Situation {
            curvature_1_m,
            speed_m_s: SPEED_M_S,
            stuck: [false; _],
            soil: Soil::uniform(friction, shear_modulus),
            condition: Condition {
                slope_rad,
                side_slope_rad,
                ..Condition::default()
            },
        };
        let [forward, lateral, yaw] = self.model.solve(&situation, None).ok()?.velocity;
        Some([yaw, forward, lateral].map(|velocity| velocity / SPEED_M_S))
    }

    fn holds(&self, place: Place) -> bool {
        let tolerance = &self.tolerance;
        let most = [
            tolerance.yaw_rad_m,
            tolerance.forward_m_m,
            tolerance.lateral_m_m,
        ];
        let is_within = |&curvature: &f64| {
            let here = self.per_metre(place, curvature)?;
            let usual = self.per_metre(self.usual, curvature)?;
            let differences = here.into_iter().zip(usual).zip(most);
            Some(
                differences
                    .into_iter()
                    .all(|((a, b), most)| (a - b).abs() <= most),
            )
        };
        let all = self.curvatures_1_m.iter();
        all.map(is_within).all(|is_within| is_within == Some(true))
    }
}

/// The ground along a path.
#[derive(Debug, Clone)]
pub struct Ground {
    draws: [Option<Draw>; 4],
    usual: Place,
    from: Place,
    to: Place,
    /// Driven since the last draw, m.
    driven_m: f64,
    /// Way until the next draw, m; never without one.
    each: Option<Draw>,
    each_m: f64,
    over: Option<Draw>,
    over_m: f64,
    within: Option<Within>,
    run: usize,
    rng: Pcg64Mcg,
}

impl Ground {
    /// The ground of a run in the simulator's usual one, and the settings at its beginning.
    pub fn new(
        world: &World,
        usual: &mut Simulator,
        (robot, curvature_max_1_m): (&Description, f64),
        run: usize,
        rng: Pcg64Mcg,
    ) -> Self {
        let level = [usual.friction, usual.shear_modulus, 0.0, 0.0];
        let within = world
            .within_tolerance
            .then(|| Within::new(robot, level, curvature_max_1_m));
        let mut ground = Self {
            draws: [
                world.friction.clone(),
                world.shear_modulus.clone(),
                world.slope_rad.clone(),
                world.side_slope_rad.clone(),
            ],
            usual: level,
            within: within.flatten(),
            from: [0.0; 4],
            to: [0.0; 4],
            driven_m: 0.0,
            each: world.ground_each_m.clone(),
            each_m: f64::INFINITY,
            over: world.ground_over_m.clone(),
            over_m: OVER_MIN_M,
            run,
            rng,
        };
        ground.draw();
        ground.from = ground.to;
        [usual.friction, usual.shear_modulus, ..] = ground.to;
        ground
    }

    fn draw(&mut self) {
        self.from = self.to;
        for _ in 0..DRAWS_MAX {
            self.draw_place();
            let holds = |within: &Within| within.holds(self.to);
            if self.within.as_ref().is_none_or(holds) {
                break;
            }
        }
        let rng = &mut self.rng;
        let each = self.each.as_ref().map(|draw| draw.sample(self.run, rng));
        let over = self.over.as_ref().map(|draw| draw.sample(self.run, rng));
        self.each_m = each.unwrap_or(f64::INFINITY);
        self.over_m = over.unwrap_or(OVER_MIN_M).max(OVER_MIN_M);
        self.driven_m = 0.0;
    }

    fn draw_place(&mut self) {
        let rng = &mut self.rng;
        for (i, draw) in self.draws.iter().enumerate() {
            let drawn = draw.as_ref().map(|draw| draw.sample(self.run, rng));
            // Friction and shear modulus are factors on what is usual.
            self.to[i] = match i {
                0 | 1 => self.usual[i] * drawn.unwrap_or(1.0),
                _ => drawn.unwrap_or(0.0),
            };
        }
    }

    /// Lays the ground of the beginning.
    ///
    /// # Errors
    /// A ground that the simulator refuses.
    pub fn begin(&self, world: &mut Simulated) -> Result<(), WorldError> {
        lay(self.to, world)
    }

    /// The robot has driven `way_m` further.
    ///
    /// # Errors
    /// A ground that the simulator refuses.
    pub fn advance(&mut self, way_m: f64, world: &mut Simulated) -> Result<(), WorldError> {
        if self.each_m.is_infinite() || way_m <= 0.0 {
            return Ok(());
        }
        let was_done = self.driven_m >= self.over_m;
        self.driven_m += way_m;
        if self.driven_m >= self.each_m.max(self.over_m) {
            self.draw();
        } else if was_done {
            return Ok(());
        }
        let share = (self.driven_m / self.over_m).min(1.0);
        let between = |i: usize| self.from[i] + share * (self.to[i] - self.from[i]);
        lay(std::array::from_fn(between), world)
    }
}

fn lay([friction, shear, ahead, aside]: Place, world: &mut Simulated) -> Result<(), WorldError> {
    world.set_ground(friction, shear)?;
    for (kind, slope_rad) in [
        (DisturbanceKind::Slope, ahead),
        (DisturbanceKind::SideSlope, aside),
    ] {
        if slope_rad != 0.0 {
            world.disturb(Disturbance {
                kind,
                place: 0,
                parameter: [slope_rad, 0.0],
            })?;
        }
    }
    Ok(())
}

/// A stream of random numbers of its own for each purpose, so that more of one change none of
/// another.
pub fn stream(seed: u64, purpose: u64) -> Pcg64Mcg {
    use rand::SeedableRng;
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ (purpose.wrapping_add(1)) << 48);
    let _ = rng.next_u64();
    rng
}
