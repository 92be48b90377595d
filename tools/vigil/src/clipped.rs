//! Text that is cut where its room ends.

/// The text, or its beginning with a sign that there is more.
pub fn clipped(text: &str, columns: usize) -> String {
    match text.char_indices().nth(columns) {
        None => text.to_owned(),
        Some(_) => {
            let kept = text.chars().take(columns.saturating_sub(1));
            kept.chain(['…']).collect()
        }
    }
}
