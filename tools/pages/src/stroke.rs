//! How curves are drawn, beside their colour.

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// A line.
    Solid,
    /// A thin line.
    Thin,
    /// A broken line.
    Dashed,
    /// A line of dots.
    Dotted,
    /// A filled circle at each point.
    Dots,
    /// The area within, through which the rest shows.
    Area,
}
