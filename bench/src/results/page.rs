//! The page of results: of each question what was found last.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::ResultFile;
use super::shorten::shortened;
use crate::machine;

/// Lines of a question at most.
const LINES_MAX: usize = 60;
/// Columns of a line that can be broken.
const COLUMNS_MAX: usize = 120;

const HEAD: &str = "# Results

Of each question what was measured last: written by `scripts/bench page` from `results/`, not by
hand. Scenarios stand in [field.toml](field.toml); a question is a file in `bench/src/questions`.
What a figure of `field` means stands in `tools/evaluation/src/scoring/field.rs`.

A result is one file, `results/<date>-<machine>/<question>.json`. It holds the lines that are shown
here, all of them if they are not too many, the command, the commit, facts about the machine,
figures for programs, and size and CRC-32 of the raw data. These lie in `target/bench/<question>/`
where it was measured. With `--json` a question prints the same and keeps nothing; the keys stand in
[result.schema.json](result.schema.json). `-` for a percentile: there are too few samples for it.
";

/// The page, Markdown.
#[must_use]
pub fn page(results: &[ResultFile]) -> String {
    let mut newest = BTreeMap::new();
    let mut in_order: Vec<&ResultFile> = results.iter().collect();
    in_order.sort_by_key(|kept| (&kept.run.date, &kept.path));
    for kept in in_order {
        newest.insert(&kept.run.question, kept);
    }
    let mut text = HEAD.to_owned();
    for kept in newest.values() {
        text.push_str(&section(kept));
    }
    text
}

fn section(ResultFile { path, run }: &ResultFile) -> String {
    let command = format!("`{}`", run.command);
    let is_said = |line: &&String| line.is_empty() || **line == command;
    let whole = run.summary.iter().skip_while(is_said);
    let mut whole: Vec<String> = whole.cloned().collect();
    while whole.last().is_some_and(String::is_empty) {
        whole.pop();
    }
    let lines = shortened(&whole, |lines| wrapped(lines).len() <= LINES_MAX);
    let folder = path.split('/').next().unwrap_or_default();
    let name = folder.strip_prefix(&format!("{}-", run.date));
    // A count of lines depends on no machine.
    let machine = run.machine["processor"]
        .as_str()
        .map_or_else(String::new, |processor| {
            format!(": {processor}, {} cores", run.machine["cores"])
        });
    let command = if run.command.is_empty() {
        "Command: not known.".to_owned()
    } else {
        command
    };
    let all = if lines == whole && run.remarks.is_empty() {
        "The file"
    } else {
        "More"
    };
    let mut text = format!(
        "\n## {}\n\n{command}\n\n{}, `{}`{machine}.\n{}\n\
         {all}: [{path}](results/{path}).\n\n",
        run.question,
        run.date,
        name.unwrap_or(folder),
        machine::commit_in_words(run.commit.as_deref(), &run.machine),
    );
    for line in wrapped(&lines) {
        let _ = writeln!(text, "{line}");
    }
    text
}

/// The lines as they stand in the page: headings one level lower, long ones broken, but for tables
/// and what is quoted as it is.
fn wrapped(lines: &[String]) -> Vec<String> {
    let mut is_quoted = false;
    let mut all = Vec::new();
    for line in lines {
        let is_fence = line.starts_with("```");
        is_quoted ^= is_fence;
        if is_quoted || is_fence || line.starts_with('|') {
            all.push(line.clone());
        } else if line.starts_with('#') {
            all.push(format!("#{line}"));
        } else {
            all.extend(broken(line));
        }
    }
    all
}

/// A line, broken between words.
fn broken(line: &str) -> Vec<String> {
    let indent = if line.starts_with("- ") { "  " } else { "" };
    let mut lines = vec![String::new()];
    for (at, word) in line.split(' ').enumerate() {
        let last = lines.len() - 1;
        let columns = lines[last].chars().count() + 1 + word.chars().count();
        // At the beginning of a line these would mean something.
        let is_mark = word.starts_with(['-', '+', '*', '#', '|', '>', '=']);
        if columns > COLUMNS_MAX && !is_mark && at > 0 {
            lines.push(format!("{indent}{word}"));
            continue;
        }
        if at > 0 {
            lines[last].push(' ');
        }
        lines[last].push_str(word);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::tests::empty;
    use super::*;

    fn kept(folder: &str, date: &str, summary: &[&str]) -> ResultFile {
        let mut run = empty("latency");
        run.date = date.into();
        run.summary = summary.iter().map(|line| (*line).to_owned()).collect();
        let path = format!("{folder}/latency.json");
        ResultFile { path, run }
    }

    #[test]
    fn of_each_question_the_newest_result_is_shown() {
        let old = kept("2026-11-21-vm", "2026-11-21", &["Old."]);
        let new = kept(
            "2026-11-22-16-cores",
            "2026-11-22",
            &["", "New.", "## Part", ""],
        );
        let text = page(&[new, old]);
        let wanted = "\n## latency\n\n`scripts/bench latency`\n\n2026-11-22, `16-cores`.\n\
                      Commit: ab12.\nThe file: [2026-11-22-16-cores/latency.json]\
                      (results/2026-11-22-16-cores/latency.json).\n\nNew.\n### Part\n";
        assert_eq!(text.strip_prefix(HEAD).unwrap(), wanted);
    }

    #[test]
    fn long_lines_are_broken_and_long_tables_cut() {
        let long = format!("- {}- b", "a ".repeat(58));
        let whole = ["| a |", "|---|"].into_iter().chain([long.as_str(); 2]);
        let rows = std::iter::repeat_n("| 1 |", 80);
        let summary: Vec<&str> = whole
            .clone()
            .take(2)
            .chain(rows)
            .chain(whole.skip(2))
            .collect();
        let text = page(&[kept("2026-11-22-vm", "2026-11-22", &summary)]);
        assert!(
            text.lines()
                .all(|line| line.chars().count() <= COLUMNS_MAX + 3)
        );
        assert_eq!(text.matches("| 1 |").count(), 52, "{text}");
        assert!(text.contains("\nMore: ") && text.contains("\n... 28 more rows\n"));
        assert_eq!(broken("a b"), ["a b"]);
        assert_eq!(broken(&format!("- {} c", "x".repeat(117))).len(), 2);
    }

    #[test]
    fn the_committed_page_is_what_the_results_make() {
        let folder = crate::archive::results();
        let results = ResultFile::all(&folder).unwrap();
        let committed = std::fs::read_to_string(folder.join("../README.md")).unwrap();
        assert!(
            page(&results) == committed,
            "bench/README.md is not of these results: run `scripts/bench page`"
        );
        for kept in results {
            let bytes = kept.run.text().len();
            assert!(
                bytes <= super::super::BYTES_MAX,
                "{}: {bytes} bytes",
                kept.path
            );
            assert!(kept.path.ends_with(&format!("/{}.json", kept.run.question)));
        }
    }
}
