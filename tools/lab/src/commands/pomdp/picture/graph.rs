//! A policy's graph, as DOT and in layers.

use std::fmt::Write;

use vigil_pomdp::Pomdp;
use vigil_pomdp::policy_graph::{Edge, Node, PolicyGraph};

use super::canvas::{Anchor, Canvas, INK, Point, colour, drawing};

/// Half the width and height of a node, and from node to node.
const HALF: Point = (72.0, 30.0);
const APART: Point = (250.0, 190.0);
const MARGIN: Point = (120.0, 110.0);
/// States below this are not named in a node.
const STATE_MIN: f64 = 0.05;
/// Edges less probable than this are left out of the drawing.
const SHOWN_MIN: f64 = 0.1;

/// `NOM .94, RT .03`: the most probable states.
fn states(model: &Pomdp, node: &Node) -> String {
    let mut all: Vec<(usize, f64)> = node.belief.iter().copied().enumerate().collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let likely = all.iter().filter(|(_, b)| *b >= STATE_MIN).take(2);
    let words: Vec<String> = likely
        .map(|(s, b)| format!("{} {b:.2}", model.states()[*s]))
        .collect();
    words.join(", ")
}

/// `none +3: 0.94`, or `any` for an edge that is taken in any case.
fn label(model: &Pomdp, edge: &Edge) -> String {
    let probability = edge.probability();
    let first = edge.observations.first();
    let name = first.map_or("", |(z, _)| model.observations()[*z].as_str());
    match edge.observations.len() {
        1 => format!("{name}: {probability:.2}"),
        _ if probability > 1.0 - 1e-9 => "any: 1.00".to_owned(),
        n => format!("{name} +{}: {probability:.2}", n - 1),
    }
}

/// For Graphviz.
pub fn dot(model: &Pomdp, graph: &PolicyGraph) -> String {
    let mut text = String::from("digraph policy {\n  node [shape=box];\n");
    for (index, node) in graph.nodes.iter().enumerate() {
        let action = &model.actions()[node.action];
        let states = states(model, node);
        let first = if index == 0 { ", penwidth=2" } else { "" };
        let _ = writeln!(text, "  n{index} [label=\"{action}\\n{states}\"{first}];");
    }
    for edge in &graph.edges {
        let style = if edge.is_folded { ", style=dashed" } else { "" };
        let label = label(model, edge);
        let (from, to) = (edge.from, edge.to);
        let _ = writeln!(text, "  n{from} -> n{to} [label=\"{label}\"{style}];");
    }
    text.push_str("}\n");
    text
}

/// For each node but the start the edge by which it is reached first: from an earlier node, and
/// the most probable of such.
fn entries(graph: &PolicyGraph) -> Vec<Option<usize>> {
    let entry = |node: usize| {
        let edges = graph.edges.iter().enumerate();
        let into = edges.filter(|(_, e)| e.to == node && e.from < node && !e.is_folded);
        let weight = |e: &Edge| graph.nodes[e.from].weight * e.probability();
        let best = into.max_by(|a, b| weight(a.1).total_cmp(&weight(b.1)));
        best.map(|(index, _)| index)
    };
    (0..graph.nodes.len()).map(entry).collect()
}

/// Rows of nodes by their distance from the start, each below those that lead to it.
fn layers(graph: &PolicyGraph, entries: &[Option<usize>]) -> Vec<Vec<usize>> {
    let mut depth = vec![0; graph.nodes.len()];
    let mut layers: Vec<Vec<usize>> = Vec::new();
    for (node, entry) in entries.iter().enumerate() {
        if let Some(edge) = entry.and_then(|index| graph.edges.get(index)) {
            depth[node] = depth[edge.from] + 1;
        }
        layers.resize(layers.len().max(depth[node] + 1), Vec::new());
        layers[depth[node]].push(node);
    }
    layers
}

/// Draws it. An edge is shown if it is probable, or if a node is reached by it first.
pub fn draw(model: &Pomdp, graph: &PolicyGraph, title: &str) -> Result<String, String> {
    let entries = entries(graph);
    let layers = layers(graph, &entries);
    let widest = layers.iter().map(Vec::len).max().unwrap_or(1).max(3);
    let width = 2.0 * MARGIN.0 + APART.0 * (widest - 1) as f64;
    let height = 2.0 * MARGIN.1 + APART.1 * layers.len().saturating_sub(1) as f64 + 60.0;
    let mut places = vec![(0.0, 0.0); graph.nodes.len()];
    for (row, layer) in layers.iter().enumerate() {
        let span = APART.0 * (layer.len() - 1) as f64;
        for (column, &node) in layer.iter().enumerate() {
            let x = 0.5 * (width - span) + APART.0 * column as f64;
            places[node] = (x, MARGIN.1 + APART.1 * row as f64);
        }
    }
    let edges = graph.edges.iter().enumerate();
    let shown = edges.filter(|(i, e)| e.probability() >= SHOWN_MIN || entries.contains(&Some(*i)));
    let shown: Vec<&Edge> = shown.map(|(_, edge)| edge).collect();
    drawing((width as u32, height as u32), |canvas| {
        canvas.text(
            &format!("Policy graph, {title}"),
            (20.0, 24.0),
            20,
            Anchor::Left,
        );
        for edge in &shown {
            connect(canvas, edge, &places);
        }
        for (index, (node, &(x, y))) in graph.nodes.iter().zip(&places).enumerate() {
            let box_of = |grow: f64| {
                let (dx, dy) = (HALF.0 + grow, HALF.1 + grow);
                [(x - dx, y - dy), (x + dx, y + dy)]
            };
            canvas.frame(box_of(0.0), colour(node.action));
            if index == 0 {
                canvas.frame(box_of(5.0), colour(node.action));
            }
            canvas.text(
                &model.actions()[node.action],
                (x, y - 11.0),
                18,
                Anchor::Middle,
            );
            canvas.text(&states(model, node), (x, y + 12.0), 13, Anchor::Middle);
        }
        let mut taken: Vec<(Point, Point)> = places.iter().map(|p| (*p, HALF)).collect();
        for edge in &shown {
            let words = label(model, edge);
            let place = label_place(&curve(edge, &places), words.len(), &taken);
            canvas.text(&words, place.0, 13, Anchor::Middle);
            taken.push(place);
        }
        let notes = [
            "box: action, most probable states; double: start; broken: to the nearest box",
            "edges below 10 % are left out, but for the first into each box; .dot has all",
        ];
        for (note, up) in notes.into_iter().zip([36.0, 16.0]) {
            canvas.text(note, (20.0, height - up), 14, Anchor::Left);
        }
    })
}

/// Points of an edge's curve.
fn curve(edge: &Edge, places: &[Point]) -> Vec<Point> {
    let (a, b) = (places[edge.from], places[edge.to]);
    let bezier = |a: Point, c: Point, d: Point, b: Point| -> Vec<Point> {
        let point = |k: usize| {
            let t = k as f64 / 40.0;
            let u = 1.0 - t;
            let weights = [u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t];
            let sum = |of: fn(Point) -> f64| -> f64 {
                [a, c, d, b]
                    .into_iter()
                    .zip(weights)
                    .map(|(p, w)| of(p) * w)
                    .sum()
            };
            (sum(|p| p.0), sum(|p| p.1))
        };
        (0..=40).map(point).collect()
    };
    if edge.from == edge.to {
        // A loop at the right; folded ones at the left.
        let side = if edge.is_folded { -1.0 } else { 1.0 };
        let (x, y) = (a.0 + side * HALF.0, a.1);
        let out = x + side * 52.0;
        return bezier(
            (x, y - 12.0),
            (out, y - 30.0),
            (out, y + 30.0),
            (x, y + 12.0),
        );
    }
    // Bent to one side, as seen from its start: there and back do not cover each other.
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy).max(1.0);
    let bend = 0.16 * length * if edge.is_folded { 1.5 } else { 1.0 };
    let aside = (-dy / length * bend, dx / length * bend);
    let control = |share: f64| (a.0 + share * dx + aside.0, a.1 + share * dy + aside.1);
    let all = bezier(a, control(0.3), control(0.7), b);
    let is_outside = |p: &Point, of: Point| {
        (p.0 - of.0).abs() > HALF.0 + 3.0 || (p.1 - of.1).abs() > HALF.1 + 3.0
    };
    all.into_iter()
        .filter(|p| is_outside(p, a) && is_outside(p, b))
        .collect()
}

/// Shares of an edge's way at which its label may stand, the preferred first.
const LABEL_AT: [f64; 7] = [0.6, 0.5, 0.7, 0.4, 0.3, 0.8, 0.2];
/// Half the width of a letter, and half the height of a label, with some room.
const LETTER: Point = (3.4, 8.0);

/// A place for a label of an edge where it covers none of `taken` (middles and half sizes); the
/// preferred one if there is none.
fn label_place(points: &[Point], letters: usize, taken: &[(Point, Point)]) -> (Point, Point) {
    let half = (LETTER.0 * letters as f64, LETTER.1);
    let at = |share: f64| {
        let index = (points.len() as f64 * share) as usize;
        let (x, y) = points.get(index).copied().unwrap_or_default();
        (x, y - LETTER.1)
    };
    let is_free = |place: &Point| {
        let covers = |(other, size): &(Point, Point)| {
            (place.0 - other.0).abs() < half.0 + size.0
                && (place.1 - other.1).abs() < half.1 + size.1
        };
        !taken.iter().any(covers)
    };
    let free = LABEL_AT.into_iter().map(at).find(is_free);
    (free.unwrap_or_else(|| at(LABEL_AT[0])), half)
}

fn connect(canvas: &mut Canvas<'_>, edge: &Edge, places: &[Point]) {
    let points = curve(edge, places);
    let [.., before, end] = points[..] else {
        return;
    };
    if edge.is_folded {
        canvas.dashes(&points, INK);
    } else {
        let width = 1 + (3.0 * edge.probability()).round() as u32;
        canvas.line(&points, INK, width);
    }
    let (dx, dy) = (end.0 - before.0, end.1 - before.1);
    let length = dx.hypot(dy).max(1e-9);
    let (ux, uy) = (dx / length, dy / length);
    let wing = |side: f64| {
        (
            end.0 - 10.0 * ux - side * 5.0 * uy,
            end.1 - 10.0 * uy + side * 5.0 * ux,
        )
    };
    canvas.area(&[end, wing(1.0), wing(-1.0)], INK, 1.0);
}
