//! The robot on its path: each request, what comes of it, and that nothing is driven through.

use vigil_blocks::{Action, ActionOutcome, RecoveryKind, SensorFrame, Symptoms};
use vigil_robot::ChannelMap;
use vigil_sensor_sim::{ActionGate, Navigator, NavigatorEvent, Simulation, WayAhead, World};
use vigil_setup::graph_file::{Navigation, Obstacle, Trouble, TroubleKind};

/// A straight corridor of 8 m, 2.4 m wide, changed.
fn corridor(change: impl FnOnce(&mut Navigation)) -> Navigation {
    let text = "path = [[0.0, 0.0], [8.0, 0.0]]\n\
                walls = [[-1.0, -1.2, 10.0, -1.2], [-1.0, 1.2, 10.0, 1.2]]\n";
    let mut navigation = toml::from_str(text).unwrap();
    change(&mut navigation);
    navigation
}

fn obstacle(x_m: f64, y_m: f64, radius_m: f64) -> Obstacle {
    Obstacle {
        x_m,
        y_m,
        radius_m,
        from_s: 0.0,
        until_s: None,
    }
}

fn trouble(kind: TroubleKind, at_s: f64, [x_m, y_m, yaw_rad]: [f64; 3]) -> Trouble {
    Trouble {
        kind,
        at_s,
        x_m,
        y_m,
        yaw_rad,
    }
}

/// A robot that obeys one action after the other.
struct Robot {
    simulation: Simulation,
    settings: Navigation,
    action: Action,
    frame: SensorFrame,
}

impl Robot {
    fn new(settings: Navigation) -> Self {
        let world = World::new(&robot(), &even_soil(), &[], 100.0, 1).unwrap();
        let navigator = Navigator::new(&settings, ChannelMap::new(&robot()));
        let gate = ActionGate::new(&robot().limits);
        Self {
            simulation: Simulation::new(world, gate, Some(navigator)),
            settings,
            action: Action {
                speed_scale: 1.0,
                curvature_gain: 1.0,
                valid_until_ns: u64::MAX,
                ..Action::default()
            },
            frame: SensorFrame::default(),
        }
    }

    /// Does this for at most `seconds`; what happened first, and when. Nothing is ever touched.
    fn obey(&mut self, kind: RecoveryKind, seconds: f64) -> Option<(NavigatorEvent, f64)> {
        self.action.kind = kind as u32;
        self.action.decision_seq += 1;
        for k in 1..=(seconds * 100.0) as u32 {
            self.simulation.step(0.01, Some(&self.action), 0);
            self.simulation.measure(&mut self.frame);
            let [x, y, _] = self.place();
            for o in self
                .settings
                .obstacle
                .iter()
                .filter(|o| o.until_s.is_none())
            {
                let apart_m = (x - o.x_m).hypot(y - o.y_m) - o.radius_m;
                let body_m = self.settings.body_radius_m;
                assert!(
                    apart_m > body_m - 0.02,
                    "touches at {x:.2} {y:.2}: {apart_m:.3}"
                );
            }
            if let Some(event) = self.simulation.take_event() {
                return Some((event, f64::from(k) * 0.01));
            }
        }
        None
    }

    fn place(&self) -> [f64; 3] {
        self.simulation.world.true_state().pose
    }

    /// Distance of measured and planned pose.
    fn off_plan_m(&self) -> f64 {
        let [x, y] = [self.frame.channel[0], self.frame.channel[1]];
        let [planned_x, planned_y, _] = self.frame.planned_pose;
        (x - planned_x).hypot(y - planned_y)
    }

    fn outcome(&self) -> (Option<ActionOutcome>, u32) {
        let outcome = ActionOutcome::from_repr(self.frame.action_outcome);
        (outcome, self.frame.symptoms)
    }
}

const fn ended(kind: RecoveryKind, outcome: ActionOutcome) -> NavigatorEvent {
    NavigatorEvent::Ended(kind, outcome)
}

use ActionOutcome::{Failed, Succeeded};
use RecoveryKind::{CallForHelp, GiveUp, GoOn, GoThrough, MoveAway, NewPath, Relocalise, Stop};

use crate::rover::{even_soil, robot};

#[test]
fn a_free_path_is_followed_with_the_plan_to_the_goal() {
    let mut robot = Robot::new(corridor(|_| {}));
    let (event, t_s) = robot.obey(GoOn, 60.0).unwrap();
    assert_eq!(event, NavigatorEvent::Goal);
    // 8 m at 0.25 m/s, and what slowing down at the goal takes.
    assert!((32.0..40.0).contains(&t_s), "{t_s}");
    assert!(robot.off_plan_m() < 0.2 && robot.place()[1].abs() < 0.05);
    assert_eq!(robot.obey(GoOn, 5.0), None);
    assert!((robot.place()[0] - 7.9).abs() < 0.05, "it stays there");
}

#[test]
fn the_robot_slows_down_and_stops_before_what_blocks_it_and_falls_behind_its_plan() {
    let mut robot = Robot::new(corridor(|c| c.obstacle.push(obstacle(5.0, 0.0, 0.8))));
    assert_eq!(robot.obey(GoOn, 60.0), None);
    // Contact at 3.75 m; it stands 0.8 m before, creeping no nearer than that.
    let [x, y, _] = robot.place();
    assert!((2.9..=3.05).contains(&x) && y.abs() < 0.05, "{x} {y}");
    assert!(robot.off_plan_m() > 4.0);
    // On each side the gap is 0.4 m wide.
    let (event, t_s) = robot.obey(GoThrough, 20.0).unwrap();
    assert_eq!(event, ended(GoThrough, Failed));
    assert!((t_s - robot.settings.look_s).abs() < 0.02);
    assert_eq!(robot.outcome(), (Some(Failed), 0));
    // The only path is blocked.
    let (event, t_s) = robot.obey(NewPath, 20.0).unwrap();
    assert_eq!(event, ended(NewPath, Failed));
    assert!((t_s - robot.settings.think_s).abs() < 0.02);
    assert_eq!(robot.outcome(), (Some(Failed), Symptoms::NNA));
}

#[test]
fn an_opening_beside_the_path_is_gone_through_and_the_path_taken_up_again() {
    let mut robot = Robot::new(corridor(|c| {
        c.obstacle.push(obstacle(6.0, -0.9, 0.6));
        (c.stop_m, c.slow_m) = (1.5, 3.0);
    }));
    assert_eq!(robot.obey(GoOn, 40.0), None);
    let (event, _) = robot.obey(GoThrough, 40.0).unwrap();
    assert_eq!(event, ended(GoThrough, Succeeded));
    assert_eq!(robot.outcome(), (Some(Succeeded), Symptoms::BO));
    assert!(robot.place()[1] > 0.1, "to the left of it");
    assert!(robot.off_plan_m() < 0.3, "the plan goes on from here");
    assert_eq!(robot.obey(GoOn, 40.0).unwrap().0, NavigatorEvent::Goal);
    assert!(robot.place()[1].abs() < 0.2);
}

#[test]
fn people_leave_and_the_way_is_free() {
    let mut robot = Robot::new(corridor(|c| {
        c.obstacle.push(Obstacle {
            until_s: Some(25.0),
            ..obstacle(4.0, 0.0, 1.0)
        });
    }));
    assert_eq!(robot.obey(GoOn, 22.0), None);
    let (event, t_s) = robot.obey(GoThrough, 40.0).unwrap();
    assert_eq!(event, ended(GoThrough, Succeeded));
    assert!(t_s > 3.0, "not before they have left");
    // Or it waits: the plan then goes on from where it is.
    let mut waits = Robot::new(robot.settings.clone());
    assert_eq!(waits.obey(GoOn, 24.5), None);
    assert!(waits.off_plan_m() > 2.0);
    assert_eq!(waits.obey(GoOn, 1.5), None);
    assert!(waits.off_plan_m() < 0.5);
    assert_eq!(waits.obey(GoOn, 60.0).unwrap().0, NavigatorEvent::Goal);
}

#[test]
fn what_blocks_is_not_forgotten_by_what_did_not_help() {
    let mut robot = Robot::new(corridor(|c| {
        c.obstacle.push(obstacle(6.0, 0.0, 1.0));
        (c.stop_m, c.slow_m) = (1.5, 3.0);
    }));
    assert_eq!(robot.obey(GoOn, 60.0), None);
    // Whatever was tried before: there is no opening, and no other path.
    for before in [NewPath, MoveAway, Relocalise] {
        robot.obey(before, 20.0).unwrap();
        for kind in [GoThrough, NewPath] {
            let (event, _) = robot.obey(kind, 40.0).unwrap();
            assert_eq!(event, ended(kind, Failed), "after {before:?}");
        }
    }
}

#[test]
fn an_opening_past_an_obstacle_does_not_clear_a_phantom_elsewhere() {
    let mut robot = Robot::new(corridor(|c| {
        c.obstacle.push(obstacle(3.5, -0.9, 0.5));
        c.trouble
            .push(trouble(TroubleKind::Phantom, 0.0, [7.5, 0.0, 0.0]));
    }));
    assert_eq!(robot.obey(GoOn, 30.0), None);
    let (event, _) = robot.obey(GoThrough, 40.0).unwrap();
    assert_eq!(event, ended(GoThrough, Succeeded));
    let past_m = robot.place()[0];
    assert_eq!(robot.obey(GoOn, 40.0), None, "the phantom still stops it");
    assert!(
        (past_m..6.6).contains(&robot.place()[0]),
        "{:?}",
        robot.place()
    );
}

#[test]
fn the_alternative_is_taken_once() {
    let mut robot = Robot::new(corridor(|c| {
        c.walls.clear();
        c.alternative = vec![[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [8.0, 3.0], [8.0, 0.0]];
        c.obstacle.push(obstacle(6.0, 0.0, 1.0));
        (c.stop_m, c.slow_m) = (2.0, 3.5);
    }));
    assert_eq!(robot.obey(GoOn, 15.0), None);
    let (event, _) = robot.obey(NewPath, 5.0).unwrap();
    assert_eq!(event, ended(NewPath, Succeeded));
    assert_eq!(robot.outcome(), (Some(Succeeded), Symptoms::ALT));
    assert!(robot.off_plan_m() < 0.2);
    assert_eq!(robot.obey(GoOn, 120.0).unwrap().0, NavigatorEvent::Goal);
}

#[test]
fn moving_away_backs_and_stops_at_what_is_behind() {
    let mut robot = Robot::new(corridor(|_| {}));
    robot.obey(GoOn, 10.0);
    let before = robot.place()[0];
    let (event, _) = robot.obey(MoveAway, 20.0).unwrap();
    assert_eq!(event, ended(MoveAway, Succeeded));
    let back_m = before - robot.place()[0];
    assert!((0.5..0.75).contains(&back_m), "{back_m}");
    assert!(robot.off_plan_m() < 0.1, "the plan goes on from there");
    // A wall just behind the start.
    let mut robot = Robot::new(corridor(|c| c.walls.push([-0.6, -1.2, -0.6, 1.2])));
    let (event, _) = robot.obey(MoveAway, 20.0).unwrap();
    assert_eq!(event, ended(MoveAway, Failed));
    assert!(robot.place()[0] > -0.15, "{:?}", robot.place());
}

#[test]
fn a_jump_of_the_believed_pose_lasts_until_the_robot_finds_its_place() {
    let jump = [0.4, -0.3, 0.2];
    let mut robot = Robot::new(corridor(|c| {
        c.trouble
            .push(trouble(TroubleKind::Mislocalised, 5.0, jump));
    }));
    robot.obey(GoOn, 4.9);
    assert!(robot.off_plan_m() < 0.2);
    robot.obey(GoOn, 0.2);
    let [x, y, yaw] = robot.place();
    let seen = robot.frame.channel;
    let off = [
        seen[0] - x - jump[0],
        seen[1] - y - jump[1],
        seen[2] - yaw - jump[2],
    ];
    assert!(off.iter().all(|off| off.abs() < 0.05), "{off:?}");
    assert_eq!(robot.frame.pose_reset_count, 0);
    let (event, _) = robot.obey(Relocalise, 5.0).unwrap();
    assert_eq!(event, ended(Relocalise, Succeeded));
    assert_eq!(robot.frame.pose_reset_count, 1);
    let ([x, y, _], seen) = (robot.place(), robot.frame.channel);
    assert!((seen[0] - x).hypot(seen[1] - y) < 0.05);
    assert!(robot.off_plan_m() < 0.3);
    // Who knows the place finds no other.
    robot.obey(Relocalise, 5.0);
    assert_eq!(robot.frame.pose_reset_count, 1);
}

#[test]
fn a_phantom_stops_the_robot_and_a_blind_one_stops_at_touch() {
    let phantom = trouble(TroubleKind::Phantom, 0.0, [4.0, 0.0, 0.0]);
    let mut robot = Robot::new(corridor(|c| c.trouble.push(phantom)));
    assert_eq!(robot.obey(GoOn, 40.0), None);
    assert!(robot.place()[0] < 2.4);
    let (event, _) = robot.obey(GoThrough, 40.0).unwrap();
    assert_eq!(event, ended(GoThrough, Succeeded));
    assert_eq!(robot.obey(GoOn, 40.0).unwrap().0, NavigatorEvent::Goal);

    let blind = trouble(TroubleKind::Blind, 0.0, [0.0; 3]);
    let mut robot = Robot::new(corridor(|c| {
        c.trouble.push(blind);
        c.obstacle.push(obstacle(5.0, 0.0, 0.8));
    }));
    assert_eq!(robot.obey(GoOn, 40.0), None);
    assert!((robot.place()[0] - 3.75).abs() < 0.1, "{:?}", robot.place());
}

#[test]
fn a_wrong_heading_leads_off_the_path_until_it_is_planned_anew() {
    let wrong = trouble(TroubleKind::WrongHeading, 3.0, [0.0, 0.0, 1.2]);
    let mut robot = Robot::new(corridor(|c| {
        c.walls.clear();
        c.trouble.push(wrong);
    }));
    assert_eq!(robot.obey(GoOn, 20.0), None);
    assert!(robot.place()[1] > 0.5, "{:?}", robot.place());
    assert_eq!(
        robot.obey(NewPath, 5.0).unwrap().0,
        ended(NewPath, Succeeded)
    );
    assert!(robot.off_plan_m() < 0.2);
    assert_eq!(robot.obey(GoOn, 60.0).unwrap().0, NavigatorEvent::Goal);
}

#[test]
fn help_clears_the_way_and_begins_a_new_run() {
    let mut robot = Robot::new(corridor(|c| c.obstacle.push(obstacle(5.0, 0.0, 1.2))));
    assert_eq!(robot.obey(GoOn, 30.0), None);
    let run = robot.frame.run_id;
    let (event, t_s) = robot.obey(CallForHelp, 30.0).unwrap();
    assert_eq!(event, ended(CallForHelp, Succeeded));
    assert!((t_s - robot.settings.help_s).abs() < 0.02);
    assert_ne!(robot.frame.run_id, run);
    robot.settings.obstacle.clear();
    assert_eq!(robot.obey(GoOn, 60.0).unwrap().0, NavigatorEvent::Goal);
}

#[test]
fn what_is_wrong_with_the_navigation_is_told() {
    let way = |change: fn(&mut Navigation), seconds: f64| {
        let mut robot = Robot::new(corridor(change));
        robot.obey(GoOn, seconds);
        robot.simulation.navigation_condition(2.5).unwrap().way
    };
    assert_eq!(way(|_| {}, 10.0), WayAhead::Free);
    assert_eq!(
        way(|c| c.obstacle.push(obstacle(6.0, 0.0, 1.2)), 1.0),
        WayAhead::Free
    );
    assert_eq!(
        way(|c| c.obstacle.push(obstacle(4.0, 0.0, 1.2)), 30.0),
        WayAhead::Filled
    );
    let leaves = |c: &mut Navigation| {
        let until_s = Some(60.0);
        c.obstacle.push(Obstacle {
            until_s,
            ..obstacle(4.0, 0.0, 1.2)
        });
    };
    assert_eq!(way(leaves, 30.0), WayAhead::Crowded);
    // Past this there is a way, but not from so near that the robot cannot turn to it.
    let aside = |c: &mut Navigation| c.obstacle.push(obstacle(4.0, -0.9, 0.6));
    assert_eq!(way(aside, 9.0), WayAhead::Passable);
    let near = |c: &mut Navigation| {
        (c.stop_m, c.slow_m) = (0.2, 0.5);
        c.obstacle.push(obstacle(4.0, -0.9, 0.6));
    };
    assert_eq!(way(near, 60.0), WayAhead::TooNear);

    let mut robot = Robot::new(corridor(|c| {
        c.trouble = vec![
            trouble(TroubleKind::Mislocalised, 1.0, [0.5, 0.0, 0.0]),
            trouble(TroubleKind::WrongHeading, 2.0, [0.0, 0.0, 0.4]),
        ];
    }));
    let said = |robot: &Robot| {
        let condition = robot.simulation.navigation_condition(2.5).unwrap();
        (
            condition.is_lost,
            condition.heads_wrong,
            condition.has_other_way,
        )
    };
    assert_eq!(said(&robot), (false, false, false));
    robot.obey(GoOn, 1.5);
    assert_eq!(said(&robot), (true, false, false));
    robot.obey(GoOn, 1.0);
    assert_eq!(said(&robot), (true, true, false));
    robot.obey(Relocalise, 5.0);
    assert_eq!(said(&robot), (false, false, false));
}

#[test]
fn a_robot_at_a_wall_backs_off_or_is_set_on_its_path() {
    let wrong = trouble(TroubleKind::WrongHeading, 3.0, [0.0, 0.0, 1.2]);
    let at_the_wall = || {
        let mut robot = Robot::new(corridor(|c| c.trouble.push(wrong.clone())));
        assert_eq!(robot.obey(GoOn, 30.0), None);
        assert!(robot.simulation.touches());
        robot
    };
    let mut backs = at_the_wall();
    let y_m = backs.place()[1];
    let (event, _) = backs.obey(MoveAway, 30.0).unwrap();
    assert_eq!(event, ended(MoveAway, Succeeded));
    assert!(backs.place()[1] < y_m - 0.1, "{:?}", backs.place());

    let mut helped = at_the_wall();
    let along_m = helped.place()[0];
    let (event, _) = helped.obey(CallForHelp, 30.0).unwrap();
    assert_eq!(event, ended(CallForHelp, Succeeded));
    let [x, y, yaw_rad] = helped.place();
    assert!((x - along_m).abs() < 0.2 && y.abs() < 1e-6 && yaw_rad.abs() < 1e-6);
    assert_eq!(helped.obey(GoOn, 60.0).unwrap().0, NavigatorEvent::Goal);
}

#[test]
fn giving_up_and_stopping_stand_and_are_done_at_once() {
    for kind in [Stop, GiveUp] {
        let mut robot = Robot::new(corridor(|_| {}));
        robot.obey(GoOn, 5.0);
        assert_eq!(
            robot.obey(kind, 1.0).unwrap(),
            (ended(kind, Succeeded), 0.01)
        );
        let before = robot.place()[0];
        assert_eq!(robot.obey(GoOn, 0.01), None);
        assert!(robot.place()[0] - before < 0.01);
    }
}

#[test]
fn without_an_action_the_robot_stands_and_its_time_does_too() {
    let mut robot = Robot::new(corridor(|c| {
        c.trouble
            .push(trouble(TroubleKind::Mislocalised, 0.5, [1.0, 0.0, 0.0]));
    }));
    for _ in 0..500 {
        robot.simulation.step(0.01, None, 0);
        robot.simulation.measure(&mut robot.frame);
    }
    assert_eq!(
        (robot.place(), robot.frame.planned_pose),
        ([0.0; 3], [0.0; 3])
    );
    assert!(robot.frame.channel[0].abs() < 0.1);
    assert_eq!(robot.frame.safe_stop, 1);
}
