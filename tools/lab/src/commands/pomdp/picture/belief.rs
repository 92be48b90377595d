//! The belief over time, as stacked areas.

use vigil_pomdp::{Evidence, Pomdp, Tracker};

use super::canvas::{AXIS, INK, legend};
use vigil_pages::colour::middle as colour;
use vigil_pages::svg::{Anchor, Drawing};

const LEFT: f64 = 60.0;
const TOP: f64 = 50.0;
const HEIGHT: f64 = 320.0;
/// Least and most width of one step.
const STEP: [f64; 2] = [56.0, 140.0];
/// States whose share is never above this have no name beside the drawing.
const SHOWN_MIN: f64 = 0.01;

/// Draws the start belief and that after each step; below each step its action and observation.
pub fn draw(model: &Pomdp, steps: &[(usize, usize)], title: &str) -> Result<String, String> {
    if steps.is_empty() {
        return Err("--belief: allowed are one step or more".to_owned());
    }
    let mut tracker = Tracker::new(model);
    let mut beliefs = vec![tracker.belief().to_vec()];
    let mut is_impossible = vec![false];
    for &(action, observation) in steps {
        let evidence = tracker.update(model, action, observation);
        is_impossible.push(evidence == Evidence::Impossible);
        beliefs.push(tracker.belief().to_vec());
    }
    let step = (1000.0 / steps.len() as f64).clamp(STEP[0], STEP[1]);
    let width = step * steps.len() as f64;
    let largest = |s: usize| beliefs.iter().map(|b| b[s]).fold(0.0, f64::max);
    let shown: Vec<(usize, &str)> = (0..model.states().len())
        .filter(|&s| largest(s) > SHOWN_MIN)
        .map(|s| (s, model.states()[s].as_str()))
        .collect();
    let names = shown.iter().map(|(_, name)| name.len()).max().unwrap_or(0);
    let right = 60.0 + 10.0 * names as f64;
    let bottom = (TOP + HEIGHT + 84.0).max(TOP + 24.0 * shown.len() as f64 + 20.0);
    let mut canvas = Drawing::new(INK);
    canvas.text(&format!("Belief, {title}"), (LEFT, 24.0), 20, Anchor::Start);
    let x = |t: usize| LEFT + step * t as f64;
    let y = |p: f64| TOP + HEIGHT * (1.0 - p);
    let below = |t: usize, s: usize| -> f64 { beliefs[t][..s].iter().sum() };
    for s in 0..model.states().len() {
        let upper = (0..beliefs.len()).map(|t| (x(t), y(below(t, s + 1).min(1.0))));
        let lower = (0..beliefs.len()).rev().map(|t| (x(t), y(below(t, s))));
        let outline: Vec<_> = upper.chain(lower).collect();
        canvas.area(&outline, colour(s), 0.8);
    }
    for p in [0.0, 0.25, 0.5, 0.75, 1.0] {
        canvas.text(&p.to_string(), (LEFT - 8.0, y(p)), 16, Anchor::End);
        canvas.line(&[(LEFT - 5.0, y(p)), (LEFT, y(p))], AXIS);
    }
    for (t, &(action, observation)) in steps.iter().enumerate() {
        let (x, base) = (x(t + 1), TOP + HEIGHT);
        canvas.line(&[(x, base), (x, base + 6.0)], AXIS);
        canvas.text(
            &model.actions()[action],
            (x, base + 20.0),
            16,
            Anchor::Middle,
        );
        let mark = if is_impossible[t + 1] { " (!)" } else { "" };
        let seen = format!("{}{mark}", model.observations()[observation]);
        canvas.text(&seen, (x, base + 42.0), 14, Anchor::Middle);
    }
    let note = "action and observation of each step; (!): impossible by the model";
    canvas.text(note, (LEFT, TOP + HEIGHT + 68.0), 14, Anchor::Start);
    canvas.text("start", (LEFT, TOP + HEIGHT + 20.0), 14, Anchor::Middle);
    legend(&mut canvas, &shown, (LEFT + width + 20.0, TOP + 10.0));
    Ok(canvas.file(LEFT + width + right, bottom))
}
