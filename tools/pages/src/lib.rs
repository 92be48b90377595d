//! Pages of HTML with charts as SVG, which open anywhere without a network.

pub mod chart;
pub mod page;
