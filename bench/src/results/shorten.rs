//! Long summaries, cut to what has room.

/// Rows that each table keeps at least, as long as there is room for that.
const ROWS_MIN: usize = 3;
/// Lines of a table above its rows.
const HEAD: usize = 2;

/// The lines, with as many first rows of each table as `fits` allows; if it allows no three, as
/// many first lines of that as it does.
pub(super) fn shortened(lines: &[String], fits: impl Fn(&[String]) -> bool) -> Vec<String> {
    if fits(lines) {
        return lines.to_vec();
    }
    let rows = (ROWS_MIN..lines.len()).rev();
    let found = rows
        .map(|rows| with_rows(lines, rows))
        .find(|cut| fits(cut));
    found.unwrap_or_else(|| {
        let least = with_rows(lines, ROWS_MIN);
        let first = |count: usize| {
            let mut first = least[..count].to_vec();
            first.extend([
                String::new(),
                format!("... {} more lines", least.len() - count),
            ]);
            first
        };
        let counts = (0..least.len()).rev();
        counts.map(first).find(|cut| fits(cut)).unwrap_or_default()
    })
}

/// The lines, with at most so many rows in each table.
fn with_rows(lines: &[String], rows: usize) -> Vec<String> {
    let is_row = |line: &String| line.starts_with('|');
    let mut kept = Vec::new();
    for group in lines.chunk_by(|a, b| is_row(a) == is_row(b)) {
        let room = HEAD + rows;
        if is_row(&group[0]) && group.len() > room {
            kept.extend_from_slice(&group[..room]);
            let more = format!("... {} more rows", group.len() - room);
            kept.extend([String::new(), more]);
        } else {
            kept.extend_from_slice(group);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<String> {
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn every_table_keeps_its_first_rows() {
        let table = "| a |\n|---|\n| 1 |\n| 2 |\n| 3 |\n| 4 |\n| 5 |\n| 6 |\n";
        let text = lines(&format!("First.\n\n{table}\nThen.\n\n{table}\nLast."));
        assert_eq!(shortened(&text, |cut| cut.len() <= 23), text);
        let cut = "| a |\n|---|\n| 1 |\n| 2 |\n| 3 |\n\n... 3 more rows\n";
        let wanted = lines(&format!("First.\n\n{cut}\nThen.\n\n{cut}\nLast."));
        assert_eq!(shortened(&text, |cut| cut.len() <= 21), wanted);
        let first = shortened(&text, |cut| cut.len() <= 5);
        assert_eq!(first, lines("First.\n\n| a |\n\n... 18 more lines"));
        assert!(shortened(&text, |_| false).is_empty());
    }
}
