//! What is to be driven, and what goes wrong.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_setup::graph_file::{Navigation, Obstacle, Simulator, Trouble, TroubleKind};

use super::exception::{Exception, Group};
use super::layout::{HALF_M, Layout};
use crate::missions::{Cause, drawn_soil, drawn_wheel, encoder, stuck};
use crate::variation::Variation;

/// Share of missions without an exception, and of those with two.
const NOTHING: f64 = 0.15;
const TWO: f64 = 0.3;
/// When it begins, s: on the way.
const BEGINS_S: std::ops::Range<f64> = 3.0..15.0;
/// How long people stay after the robot has come to them, s.
const STAY_S: std::ops::Range<f64> = 5.0..60.0;
/// What fills a corridor: a disc of a radius this much, m, above half of its width, which can be
/// passed on no side, and how far it is from the middle at most.
const FILLS_M: f64 = 0.05;
const ASIDE_M: f64 = 0.2;
/// What can be passed: its radius and the distance of its middle from a wall, m.
const PASSED_M: std::ops::Range<f64> = 0.4..0.6;
const FROM_WALL_M: f64 = 0.3;
/// A person's radius, and how far three people abreast stand apart, m.
const PERSON_M: f64 = 0.25;
const ABREAST_M: f64 = 0.7;
/// Free way before and behind what stands in the way, m.
const BEFORE_M: f64 = 3.5;
const BEHIND_M: f64 = 2.0;
/// Jump of the believed pose: of the place, m, and of the heading, rad.
const JUMP_M: std::ops::Range<f64> = 0.3..1.0;
const JUMP_RAD: std::ops::Range<f64> = 0.1..0.4;
/// Turn of a wrong heading, rad.
const TURN_RAD: std::ops::Range<f64> = 0.5..1.2;

/// A fault of the hardware.
#[derive(Debug, Clone, PartialEq)]
pub struct HardwareFault {
    /// When it begins, s.
    pub at_s: f64,
    /// Change of the world, as `vigil inject` takes it.
    pub change: String,
    /// What it is.
    pub cause: Cause,
}

/// A mission.
#[derive(Debug, Clone)]
pub struct CorridorPlan {
    /// Seed of everything in it.
    pub seed: u64,
    /// Soil, noise, lag.
    pub simulator: Simulator,
    /// Corridor, what stands in it, and what happens to the robot.
    pub navigation: Navigation,
    /// What breaks.
    pub hardware: Option<HardwareFault>,
    /// What goes wrong.
    pub exceptions: Vec<Exception>,
}

impl CorridorPlan {
    /// The mission of a seed, with the settings of `shipped` and what `variation` changes.
    #[must_use]
    pub fn new(shipped: &Navigation, variation: &Variation, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0xc022_1d02);
        let mut layout = Layout::drawn(shipped, variation.corridor_half_m(HALF_M), &mut rng);
        layout.navigation.speed_m_s *= variation.speed_scale();
        let mut simulator = drawn_soil(&mut rng);
        variation.change_world(&mut simulator);
        let exceptions = exceptions(&mut rng);
        let mut plan = Self {
            seed,
            simulator,
            navigation: layout.navigation.clone(),
            hardware: None,
            exceptions: Vec::new(),
        };
        for exception in exceptions {
            plan.add(exception, &layout, &mut rng);
            plan.exceptions.push(exception);
        }
        plan
    }

    /// What goes wrong, in words.
    #[must_use]
    pub fn name(&self) -> String {
        let names: Vec<&str> = self.exceptions.iter().map(|it| it.name()).collect();
        match names.is_empty() {
            true => Group::Nothing.name().to_owned(),
            false => names.join(" + "),
        }
    }

    /// How far a pose is from the end of the way, m.
    #[must_use]
    pub fn off_goal_m(&self, pose: [f64; 3]) -> f64 {
        let goal = self.navigation.path.last();
        goal.map_or(f64::INFINITY, |goal| {
            (goal[0] - pose[0]).hypot(goal[1] - pose[1])
        })
    }

    /// What it is about.
    #[must_use]
    pub fn group(&self) -> Group {
        match self.exceptions.as_slice() {
            [] => Group::Nothing,
            [only] => only.group(),
            _ => Group::Two,
        }
    }

    fn add(&mut self, exception: Exception, layout: &Layout, rng: &mut Pcg64Mcg) {
        match exception {
            Exception::Blocked => self.block(layout, rng),
            Exception::People => self.add_people(layout, rng),
            Exception::Opening => self.stand_aside(layout, rng),
            Exception::Phantom => {
                let x_m = place(layout, rng);
                let phantom = trouble(TroubleKind::Phantom, 0.0);
                self.navigation.trouble.push(Trouble { x_m, ..phantom });
            }
            Exception::Blind => {
                self.navigation
                    .trouble
                    .push(trouble(TroubleKind::Blind, 0.0));
                self.stand_aside(layout, rng);
            }
            Exception::Lost => {
                let (jump_m, to) = (rng.random_range(JUMP_M), rng.random_range(0.0..1.0));
                let (sin, cos) = (std::f64::consts::TAU * to).sin_cos();
                let yaw_rad = signed(JUMP_RAD, rng);
                let at_s = rng.random_range(BEGINS_S);
                self.navigation.trouble.push(Trouble {
                    x_m: jump_m * cos,
                    y_m: jump_m * sin,
                    yaw_rad,
                    ..trouble(TroubleKind::Mislocalised, at_s)
                });
            }
            Exception::WrongHeading => {
                let (at_s, yaw_rad) = (rng.random_range(BEGINS_S), signed(TURN_RAD, rng));
                let turned = trouble(TroubleKind::WrongHeading, at_s);
                self.navigation.trouble.push(Trouble { yaw_rad, ..turned });
            }
            Exception::Stuck => {
                let (change, cause) = stuck(drawn_wheel(rng));
                self.breaks(change, cause, rng);
            }
            Exception::Encoder => {
                let (change, cause) = encoder(drawn_wheel(rng), rng);
                self.breaks(change, cause, rng);
            }
        }
    }

    fn breaks(&mut self, change: String, cause: Cause, rng: &mut Pcg64Mcg) {
        self.hardware = Some(HardwareFault {
            at_s: rng.random_range(BEGINS_S),
            change,
            cause,
        });
    }

    /// Where another way turns off, what fills the first lies behind that.
    fn block(&mut self, layout: &Layout, rng: &mut Pcg64Mcg) {
        let x_m = match layout.has_alternative {
            true => layout.leg_m - ASIDE_M,
            false => place(layout, rng),
        };
        let y_m = rng.random_range(-ASIDE_M..ASIDE_M);
        self.navigation.obstacle.push(Obstacle {
            y_m,
            ..obstacle(x_m, layout.half_m + FILLS_M)
        });
    }

    fn add_people(&mut self, layout: &Layout, rng: &mut Pcg64Mcg) {
        let x_m = place(layout, rng);
        let comes_s = x_m / self.navigation.speed_m_s;
        let until_s = comes_s + rng.random_range(STAY_S);
        for y_m in [-ABREAST_M, 0.0, ABREAST_M] {
            self.navigation.obstacle.push(Obstacle {
                y_m,
                until_s: Some(until_s),
                ..obstacle(x_m, PERSON_M)
            });
        }
    }

    fn stand_aside(&mut self, layout: &Layout, rng: &mut Pcg64Mcg) {
        let x_m = place(layout, rng);
        let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let y_m = side * (layout.half_m - FROM_WALL_M);
        let radius_m = rng.random_range(PASSED_M);
        self.navigation.obstacle.push(Obstacle {
            y_m,
            ..obstacle(x_m, radius_m)
        });
    }
}

const fn trouble(kind: TroubleKind, at_s: f64) -> Trouble {
    Trouble {
        kind,
        at_s,
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
    }
}

/// In the middle of the first leg, from the beginning on.
const fn obstacle(x_m: f64, radius_m: f64) -> Obstacle {
    Obstacle {
        x_m,
        y_m: 0.0,
        radius_m,
        from_s: 0.0,
        until_s: None,
    }
}

/// A place on the first leg, m.
fn place(layout: &Layout, rng: &mut Pcg64Mcg) -> f64 {
    rng.random_range(BEFORE_M..layout.leg_m - BEHIND_M)
}

/// A number of the range, positive or negative.
fn signed(range: std::ops::Range<f64>, rng: &mut Pcg64Mcg) -> f64 {
    let size = rng.random_range(range);
    if rng.random_bool(0.5) { size } else { -size }
}

/// None, one, or two of different groups.
fn exceptions(rng: &mut Pcg64Mcg) -> Vec<Exception> {
    let pick = |of: &[Exception], rng: &mut Pcg64Mcg| of[rng.random_range(0..of.len())];
    let share: f64 = rng.random_range(0.0..1.0);
    if share < NOTHING {
        return Vec::new();
    }
    let mut groups = vec![
        &Exception::WAY[..],
        &Exception::PLACE[..],
        &Exception::HARDWARE[..],
    ];
    if share >= NOTHING + TWO {
        return vec![pick(&groups.concat(), rng)];
    }
    groups.remove(rng.random_range(0..groups.len()));
    groups.into_iter().map(|of| pick(of, rng)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridors::CorridorGraph;

    #[test]
    fn missions_are_drawn_by_their_seed_and_their_graph_is_one_that_loads() {
        let graph = CorridorGraph::read(Variation::default(), None).unwrap();
        let plans = graph.plans(300, 9);
        let share = |group| plans.iter().filter(|it| it.group() == group).count() as f64 / 300.0;
        // A share of p has a standard error of less than .03.
        assert!(
            (share(Group::Nothing) - NOTHING).abs() < 0.1,
            "{}",
            share(Group::Nothing)
        );
        assert!((share(Group::Two) - TWO).abs() < 0.1);
        plans.iter().for_each(|plan| demand_loads(&graph, plan));
        assert_eq!(graph.plan(9).navigation, plans[0].navigation);
        assert_ne!(graph.plan(9).navigation, plans[1].navigation);
    }

    fn demand_loads(graph: &CorridorGraph, plan: &CorridorPlan) {
        let mut setup = graph.setup.clone();
        setup.file.navigation = Some(plan.navigation.clone());
        setup.file.simulator = plan.simulator.clone();
        assert!(vigil_sensor_sim::assemble(&setup, &[]).is_ok());
        for change in plan.hardware.iter().map(|it| &it.change) {
            vigil_robot::Injection::parse_change(change, &setup.robot).unwrap();
        }
    }

    #[test]
    fn every_variation_meets_the_same_exceptions_in_corridors_that_load() {
        let shipped = CorridorGraph::read(Variation::default(), None).unwrap();
        for variation in Variation::read_all().unwrap() {
            let graph = CorridorGraph::read(variation, None).unwrap();
            for (plan, other) in shipped.plans(30, 9).iter().zip(graph.plans(30, 9)) {
                assert_eq!(plan.exceptions, other.exceptions);
                demand_loads(&graph, &other);
            }
        }
    }
}
