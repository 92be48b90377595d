//! Rewards of the heuristics on public models, against an independent simulation.

use vigil_missions::simulation::{Episode, PolicyAgent, Rules, Summary, horizon, run};
use vigil_pomdp::mdp;
use vigil_pomdp::policy::{Dual, PolicyName};

use crate::public;
use crate::public::heuristics::{HEURISTICS, POLICIES, half_width};

const EPISODES: u64 = 500;

/// Those that take little time.
const FILES: [&str; 3] = ["tiger.95", "tiger.aaai", "hallway"];

#[test]
fn heuristics_earn_on_public_models_what_another_implementation_says() {
    let Some(folder) = public::folder() else {
        return;
    };
    let (mut outside, mut cells) = (0, 0);
    let rows = HEURISTICS.into_iter();
    for (file, means, half_widths) in rows.filter(|(file, ..)| FILES.contains(file)) {
        let model = public::read(&folder, file);
        let solution = mdp::solve(&model).unwrap();
        let rules = Rules {
            steps_max: horizon(model.discount(), 1000),
            is_end: Vec::new(),
        };
        for (name, mean) in POLICIES.into_iter().zip(means) {
            let half_width = half_width(name, half_widths);
            let policy: PolicyName = name.parse().unwrap();
            let decider = policy.build(&model, &solution, |i| Dual::new(i, 0.5));
            let mut agent = PolicyAgent::new(&model, decider.unwrap());
            let mission =
                |e| run(&model, &mut agent, &rules, Episode { seed: 1, number: e }).discounted;
            let summary = Summary::new(&mut (0..EPISODES).map(mission).collect::<Vec<_>>());
            // Both means are known to within their intervals.
            let both = summary.half_width.hypot(half_width);
            let sigmas = (summary.mean - mean) / (both / 1.96);
            println!(
                "{file} {name}: {:.3} ({mean}), {sigmas:.2} sigma",
                summary.mean
            );
            assert!(
                sigmas.abs() < 3.5,
                "{file} {name}: {summary:?}, reference {mean}"
            );
            outside += usize::from(sigmas.abs() > 1.96);
            cells += 1;
        }
    }
    // One in twenty is expected outside by chance; within a row they are not independent.
    assert!(cells == 30 && outside <= 4, "{outside} of {cells} outside");
}
