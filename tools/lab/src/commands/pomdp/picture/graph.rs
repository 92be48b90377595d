//! A policy's graph, as DOT and drawn.

use std::fmt::Write;
use std::panic::AssertUnwindSafe;

use layout::backends::svg::SVGWriter;
use layout::gv::{DotParser, GraphBuilder};
use vigil_pomdp::Pomdp;
use vigil_pomdp::policy_graph::{Edge, Node, PolicyGraph};

use super::canvas::INK;
use vigil_pages::colour::middle as colour;

/// States below this are not named in a node.
const STATE_MIN: f64 = 0.05;
/// Edges less probable than this are left out of the drawing: with hundreds of them nobody could
/// follow one.
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

/// For Graphviz, with these edges.
pub fn dot<'a>(
    model: &Pomdp,
    graph: &PolicyGraph,
    edges: impl IntoIterator<Item = &'a Edge>,
) -> String {
    let mut text = String::from("digraph policy {\n  node [shape=box];\n");
    let _ = writeln!(text, "  edge [color=\"{INK}\"];");
    for (index, node) in graph.nodes.iter().enumerate() {
        let action = &model.actions()[node.action];
        let states = states(model, node);
        let (colour, width) = (colour(node.action), if index == 0 { 3 } else { 1 });
        let _ = writeln!(
            text,
            "  n{index} [label=\"{action}\\n{states}\", color=\"{colour}\", penwidth={width}];"
        );
    }
    for edge in edges {
        let style = if edge.is_folded { ", style=dashed" } else { "" };
        let label = label(model, edge);
        let (from, to) = (edge.from, edge.to);
        let width = 1 + (3.0 * edge.probability()).round() as u32;
        let _ = writeln!(
            text,
            "  n{from} -> n{to} [label=\"{label}\", penwidth={width}{style}];"
        );
    }
    text.push_str("}\n");
    text
}

/// The edges to draw: the probable ones, and the most probable into each node from an earlier one,
/// by which it is first reached.
fn shown(graph: &PolicyGraph) -> impl Iterator<Item = &Edge> {
    let weight = |edge: &Edge| graph.nodes[edge.from].weight * edge.probability();
    let entry = move |node: usize| {
        let into = graph.edges.iter().enumerate();
        let into = into.filter(|(_, e)| e.to == node && e.from < node && !e.is_folded);
        let best = into.max_by(|a, b| weight(a.1).total_cmp(&weight(b.1)));
        best.map(|(index, _)| index)
    };
    let entries: Vec<Option<usize>> = (0..graph.nodes.len()).map(entry).collect();
    let edges = graph.edges.iter().enumerate();
    let is_shown = move |(index, edge): &(usize, &Edge)| {
        edge.probability() >= SHOWN_MIN || entries.contains(&Some(*index))
    };
    edges.filter(is_shown).map(|(_, edge)| edge)
}

/// Draws it, placed by the layout library.
pub fn draw(model: &Pomdp, graph: &PolicyGraph) -> Result<String, String> {
    let parsed = DotParser::new(&dot(model, graph, shown(graph))).process()?;
    let mut builder = GraphBuilder::new();
    builder.visit_graph(&parsed);
    let mut writer = SVGWriter::new();
    // Without its search for fewer crossings, which takes minutes for graphs of 60 nodes.
    let (is_debugging, is_quick, is_unplaced) = (false, true, false);
    let mut placed = builder.get();
    // The library asserts that no two boxes overlap, whatever the model.
    let place = || placed.do_it(is_debugging, is_quick, is_unplaced, &mut writer);
    if std::panic::catch_unwind(AssertUnwindSafe(place)).is_err() {
        return Err("the graph cannot be laid out: write it as .dot, for Graphviz".to_owned());
    }
    // The library's texts are black: these are readable on dark pages, too.
    let ink = format!("<style>\ntext {{ fill: {INK}; }}\n");
    let drawn = writer.finalize().replacen("<style>\n", &ink, 1);
    // Its arrowheads grow with the line and would cover the texts.
    let small = "orient=\"auto\" markerUnits=\"userSpaceOnUse\"";
    Ok(drawn
        .replace("orient=\"auto\"", small)
        .replace("context-stroke", INK))
}
