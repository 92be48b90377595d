//! Bars and curves of characters.

/// Heights of a curve.
const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Eighths of a bar's character, from 1.
const EIGHTHS: [char; 7] = ['▏', '▎', '▍', '▌', '▋', '▊', '▉'];

/// A bar of so many columns for a share of 0 to 1.
pub fn bar(share: f64, columns: usize) -> String {
    let share = if share.is_finite() { share } else { 0.0 };
    let eighths = (share.clamp(0.0, 1.0) * columns as f64 * 8.0).round() as usize;
    let mut bar = "█".repeat(eighths / 8);
    bar.extend((eighths % 8).checked_sub(1).map(|at| EIGHTHS[at]));
    let rest = columns - bar.chars().count();
    bar + &"·".repeat(rest)
}

/// A curve: a character for each value, as high as its share of `full`; a gap where there is none.
pub fn curve(values: &[Option<f64>], full: f64) -> String {
    let height = |value: f64| {
        let share = (value / full).clamp(0.0, 1.0);
        let share = if share.is_finite() { share } else { 0.0 };
        HEIGHTS[((share * 8.0) as usize).min(7)]
    };
    let character = |value: &Option<f64>| value.map_or(' ', height);
    values.iter().map(character).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_full_at_one_and_have_eighths() {
        assert_eq!(bar(1.0, 4), "████");
        assert_eq!(bar(0.5, 4), "██··");
        assert_eq!(bar(5.0 / 32.0, 4), "▋···");
        assert_eq!(bar(-1.0, 4), "····");
        assert_eq!(bar(f64::NAN, 2), "··");
        assert_eq!(bar(9.0, 2), "██");
    }

    #[test]
    fn curves_have_gaps_and_eight_heights() {
        let values = [None, Some(0.0), Some(0.5), Some(1.0), Some(7.0)];
        assert_eq!(curve(&values, 1.0), " ▁▅██");
        assert_eq!(curve(&[Some(0.0)], 0.0), "▁");
    }
}
