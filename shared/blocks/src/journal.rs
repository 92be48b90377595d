//! Journal entries: the only input of a service's `step`.

/// What a `step` is told. The same sequence of entries and the same seed give bit-identical
/// beliefs, live, in replay, in evaluation and in tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry<I> {
    /// New input.
    Frame(I),
    /// The deadline passed this many times without input: publish a prediction. The filter's state
    /// stays at the last frame, so that a late frame is folded in exactly.
    Missed(u32),
    /// From now on use at most this many particles or hypotheses.
    Budget(u32),
    /// Forget everything: a new run begins.
    Reset,
}
