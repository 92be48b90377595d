//! The code blocks of a document, and what their info strings say about them.

use std::path::Path;

/// What is to be done with a block, by its info string.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// `sh run [exit CODE|any]`: its commands run, one after another.
    Run { exit: Option<i32> },
    /// `sh run window`: its command runs beside the blocks that follow.
    Window,
    /// `sh not run: REASON`.
    NotRun(String),
    /// `text shown`: lines that the block before prints.
    Shown,
    /// `text shown window`: lines that the open window prints.
    ShownInWindow,
    /// No command, nothing printed.
    Other,
}

/// A fenced block of a document.
#[derive(Debug, Clone)]
pub struct Block {
    /// Line of its first fence, from 1.
    pub line: usize,
    pub kind: Kind,
    pub text: String,
}

impl Block {
    /// Its commands, one a line; a backslash continues a line.
    pub fn commands(&self) -> Vec<String> {
        let joined = self.text.replace("\\\n", " ");
        let lines = joined.lines().map(str::trim);
        let commands = lines.filter(|line| !line.is_empty());
        commands.map(str::to_owned).collect()
    }
}

/// Reads an info string; `Err` for a shell block that does not say whether it runs.
fn kind(info: &str) -> Result<Kind, String> {
    let reason = info.strip_prefix("sh not run: ").map(str::trim);
    match info {
        "sh run" => Ok(Kind::Run { exit: Some(0) }),
        "sh run exit any" => Ok(Kind::Run { exit: None }),
        "sh run window" => Ok(Kind::Window),
        "text shown" => Ok(Kind::Shown),
        "text shown window" => Ok(Kind::ShownInWindow),
        _ if reason.is_some_and(|reason| !reason.is_empty()) => {
            Ok(Kind::NotRun(reason.unwrap_or_default().to_owned()))
        }
        _ => match info.strip_prefix("sh run exit ").map(str::parse) {
            Some(Ok(code)) => Ok(Kind::Run { exit: Some(code) }),
            _ if info.starts_with("sh") || info.starts_with("text shown") => Err(format!(
                "'{info}' is not one of: sh run, sh run exit CODE, sh run window, sh not run: \
                 REASON, text shown, text shown window"
            )),
            _ => Ok(Kind::Other),
        },
    }
}

/// The blocks of a text, or the first that cannot be read, with its line.
pub fn blocks(text: &str) -> Result<Vec<Block>, String> {
    let mut found: Vec<Block> = Vec::new();
    let mut is_open = false;
    for (index, line) in text.lines().enumerate() {
        if let Some(info) = line.strip_prefix("```") {
            is_open = !is_open;
            if is_open {
                let at = index + 1;
                found.push(Block {
                    line: at,
                    kind: kind(info).map_err(|problem| format!("line {at}: {problem}"))?,
                    text: String::new(),
                });
            }
        } else if let (true, Some(block)) = (is_open, found.last_mut()) {
            block.text.push_str(line);
            block.text.push('\n');
        }
    }
    Ok(found)
}

/// The blocks of a document of the repository.
pub fn of_document(path: &Path) -> Vec<Block> {
    let text = std::fs::read_to_string(path).unwrap();
    blocks(&text).unwrap_or_else(|problem| panic!("{}: {problem}", path.display()))
}

/// A line without what differs between runs: numbers become `#`, spaces are collapsed.
pub fn shape(line: &str) -> String {
    let mut shape = String::new();
    let mut is_number = false;
    for word in line.split_whitespace() {
        shape.push(' ');
        for c in word.chars() {
            let goes_on = is_number && c == '.';
            if c.is_ascii_digit() {
                if !is_number {
                    shape.push('#');
                }
                is_number = true;
            } else if !goes_on {
                is_number = false;
                shape.push(c);
            }
        }
        is_number = false;
    }
    shape.trim_start().replace("-#", "#")
}

#[test]
fn info_strings_say_what_is_done() {
    let text = "```sh run\na b \\\n  c\n\nd\n```\n```text shown\nx\n```\n```sh not run: why\n```\n";
    let found = blocks(text).unwrap();
    assert_eq!(found[0].commands(), ["a b    c", "d"]);
    assert_eq!(found[1].kind, Kind::Shown);
    assert_eq!(found[2].kind, Kind::NotRun("why".into()));
    assert_eq!(found[2].line, 10);
    assert_eq!(
        blocks("```sh run exit 2\n```").unwrap()[0].kind,
        Kind::Run { exit: Some(2) }
    );
    for undecided in ["```sh\n```", "```sh not run: \n```", "```sh runs\n```"] {
        assert!(blocks(undecided).unwrap_err().starts_with("line 1: "));
    }
}

#[test]
fn numbers_do_not_count_in_a_shape() {
    let one = "   -0.009 s  supervisor  action      go_on  p=1.000";
    assert_eq!(shape(one), "# s supervisor action go_on p=#");
    assert_eq!(shape(one), shape("1.5 s supervisor action go_on p=0.2"));
    assert_ne!(shape(one), shape("1.5 s supervisor action stop p=0.2"));
}
