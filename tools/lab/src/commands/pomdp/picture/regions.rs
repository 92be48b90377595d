//! Which action a policy takes at which belief: a line for two states, a triangle for three.

use vigil_pomdp::Pomdp;
use vigil_pomdp::policy::Decider;

use super::canvas::{AXIS, INK, legend};
use vigil_pages::colour::middle as colour;
use vigil_pages::svg::{Anchor, Drawing, Pen, Point};

/// Cells along a line, and along a side of a triangle.
const CELLS: [usize; 2] = [800, 120];
const LEFT: f64 = 60.0;

/// Draws the regions. Beliefs between cells' middles are not looked at.
pub fn draw(model: &Pomdp, decider: &mut Decider, title: &str) -> Result<String, String> {
    let svg = match model.states().len() {
        2 => line(model, decider, title),
        3 => triangle(model, decider, title),
        n => {
            return Err(format!(
                "--regions: a model of {n} states; allowed are 2 and 3"
            ));
        }
    };
    // Without smoothing: cells meet without a seam.
    Ok(svg.replacen("<svg ", "<svg shape-rendering=\"crispEdges\" ", 1))
}

/// The action; a policy that remembers is asked as at the beginning of a mission.
fn action(decider: &mut Decider, belief: &[f64]) -> usize {
    decider.reset();
    decider.decide(belief).action
}

fn actions_legend(canvas: &mut Drawing, model: &Pomdp, seen: &[bool], at: Point) {
    let names = model.actions().iter().enumerate();
    let names: Vec<(usize, &str)> = names
        .filter(|(index, _)| seen[*index])
        .map(|(index, name)| (index, name.as_str()))
        .collect();
    legend(canvas, &names, at);
}

/// A drawing with its heading.
fn titled(title: &str) -> Drawing {
    let mut canvas = Drawing::new(INK);
    let title = format!("Regions, {title}");
    canvas.text(&title, (LEFT, 24.0), 20, Anchor::Start);
    canvas
}

/// Of each action of the model: whether it is among those taken.
fn taken_actions(model: &Pomdp, actions: &[usize]) -> Vec<bool> {
    let all = 0..model.actions().len();
    all.map(|action| actions.contains(&action)).collect()
}

fn line(model: &Pomdp, decider: &mut Decider, title: &str) -> String {
    let middle = |cell: usize| (cell as f64 + 0.5) / CELLS[0] as f64;
    let belief = |p: f64| [1.0 - p, p];
    let actions = (0..CELLS[0]).map(|cell| action(decider, &belief(middle(cell))));
    let actions: Vec<usize> = actions.collect();
    let seen = taken_actions(model, &actions);
    let rows = seen.iter().filter(|seen| **seen).count() as f64;
    let (top, height, width) = (60.0, 70.0, 800.0);
    let x = |p: f64| LEFT + width * p;
    let mut canvas = titled(title);
    let mut first = 0;
    for end in 1..=CELLS[0] {
        if end < CELLS[0] && actions[end] == actions[first] {
            continue;
        }
        let [a, b] = [first, end].map(|cell| x(cell as f64 / CELLS[0] as f64));
        let base = top + height;
        canvas.rectangle((a, top), (b, base), colour(actions[first]), 0.8);
        if first > 0 {
            canvas.line(&[(a, base), (a, base + 22.0)], AXIS);
            let p = first as f64 / CELLS[0] as f64;
            canvas.text(&format!("{p:.3}"), (a, base + 32.0), 14, Anchor::Middle);
        }
        first = end;
    }
    let ends = [(0.0, "0"), (1.0, "1")];
    for (p, label) in ends {
        canvas.text(label, (x(p), top + height + 14.0), 16, Anchor::Middle);
    }
    let start = x(model.start()[1]);
    canvas.area(
        &[
            (start, top),
            (start - 7.0, top - 12.0),
            (start + 7.0, top - 12.0),
        ],
        INK,
        1.0,
    );
    let what = format!(
        "probability of {} (triangle: start belief)",
        model.states()[1]
    );
    canvas.text(
        &what,
        (LEFT + 0.5 * width, top + height + 62.0),
        16,
        Anchor::Middle,
    );
    actions_legend(&mut canvas, model, &seen, (LEFT, top + height + 96.0));
    canvas.file(920.0, 250.0 + 24.0 * rows)
}

fn triangle(model: &Pomdp, decider: &mut Decider, title: &str) -> String {
    let side = 620.0;
    let high = side * 0.75_f64.sqrt();
    let corners = [
        (LEFT, 80.0 + high),
        (LEFT + side, 80.0 + high),
        (LEFT + side / 2.0, 80.0),
    ];
    let at = |belief: [f64; 3]| -> Point {
        let sum = |of: fn(&Point) -> f64| -> f64 {
            corners.iter().zip(belief).map(|(c, b)| of(c) * b).sum()
        };
        (sum(|c| c.0), sum(|c| c.1))
    };
    let cells = cells();
    let actions: Vec<usize> = cells
        .iter()
        .map(|cell| {
            let mean = |k: usize| cell.iter().map(|corner| corner[k]).sum::<f64>() / 3.0;
            action(decider, &[mean(0), mean(1), mean(2)])
        })
        .collect();
    let seen = taken_actions(model, &actions);
    let mut canvas = titled(title);
    for (cell, action) in cells.iter().zip(&actions) {
        canvas.area(&cell.map(at), colour(*action), 0.8);
    }
    canvas.line(
        &[corners[0], corners[1], corners[2], corners[0]],
        Pen { width: 2.0, ..AXIS },
    );
    for (k, (x, y)) in corners.into_iter().enumerate() {
        let y = if k == 2 { y - 16.0 } else { y + 20.0 };
        canvas.text(&model.states()[k], (x, y), 16, Anchor::Middle);
    }
    let (x, y) = at([model.start()[0], model.start()[1], model.start()[2]]);
    let mark = [(x, y - 7.0), (x + 7.0, y), (x, y + 7.0), (x - 7.0, y)];
    canvas.area(&mark, INK, 1.0);
    let what = "each corner: certain of its state; diamond: start belief";
    canvas.text(what, (LEFT, 80.0 + high + 52.0), 14, Anchor::Start);
    actions_legend(&mut canvas, model, &seen, (LEFT + side + 40.0, 100.0));
    canvas.file(900.0, 700.0)
}

/// Small triangles that fill the large one, as beliefs at their corners.
fn cells() -> Vec<[[f64; 3]; 3]> {
    let n = CELLS[1];
    let belief = |i: usize, j: usize| {
        let share = |k: usize| k as f64 / n as f64;
        [1.0 - share(i) - share(j), share(i), share(j)]
    };
    let mut cells = Vec::new();
    for i in 0..n {
        for j in 0..n - i {
            cells.push([belief(i, j), belief(i + 1, j), belief(i, j + 1)]);
            if i + j + 2 <= n {
                cells.push([belief(i + 1, j), belief(i + 1, j + 1), belief(i, j + 1)]);
            }
        }
    }
    cells
}
