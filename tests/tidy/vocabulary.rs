//! Plain words: types are nouns, functions say what they do, sentences are short.

use crate::mask::{is_word, line_of, occurrences};
use crate::source::{Source, workspace};

/// Participles and the like that say nothing as the name of a type.
const NO_NOUNS: [&str; 24] = [
    "Decided", "Driven", "Ended", "Found", "Given", "Heard", "Held", "Judged", "Kept", "Known",
    "Late", "Observed", "Prepared", "Ran", "Reported", "Said", "Scored", "Seen", "Stored", "Told",
    "Used", "Wanted", "Watched", "Obeyed",
];

/// Words of a sentence in README and docs at most.
const WORDS_MAX: usize = 40;

/// The word after the one at `at`.
fn next_word(code: &str, at: usize, length: usize) -> &str {
    let tail = code[at + length..].trim_start();
    &tail[..tail.bytes().take_while(|&b| is_word(b)).count()]
}

fn names(source: &Source) -> Vec<String> {
    let code = source.code.as_str();
    let mut found = Vec::new();
    let mut violation = |at: usize, what: String| {
        found.push(format!("{}:{}: {what}", source.path, line_of(code, at)));
    };
    for keyword in ["struct", "enum", "trait", "type"] {
        for at in occurrences(code, keyword) {
            let name = next_word(code, at, keyword.len());
            if NO_NOUNS.contains(&name) {
                violation(at, format!("{keyword} {name}"));
            }
        }
    }
    for at in occurrences(code, "fn") {
        if next_word(code, at, 2) == "of" {
            violation(at, "fn of".into());
        }
    }
    found
}

/// Sentences of running text with their first line: no code, no tables, no headings.
fn sentences(text: &str) -> Vec<(usize, String)> {
    let (mut found, mut is_code) = (Vec::new(), false);
    let mut sentence: Option<(usize, String)> = None;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with("```") {
            is_code = !is_code;
        }
        let is_running = !(is_code || line.is_empty() || line.starts_with(['#', '|', '`', '<']));
        if !is_running || line.starts_with("- ") {
            found.extend(sentence.take());
        }
        if !is_running {
            continue;
        }
        for word in line.split_whitespace() {
            let (_, words) = sentence.get_or_insert_with(|| (index + 1, String::new()));
            words.push_str(word);
            words.push(' ');
            if word
                .trim_end_matches([')', '*', '"'])
                .ends_with(['.', ':', ';', '?', '!'])
            {
                found.extend(sentence.take());
            }
        }
    }
    found.extend(sentence);
    found
}

fn long_sentences(source: &Source) -> Vec<String> {
    let all = sentences(&source.text).into_iter();
    let long = all.filter(|(_, words)| words.split(' ').count() > WORDS_MAX + 1);
    long.map(|(line, words)| {
        let count = words.trim().split(' ').count();
        format!("{}:{line}: a sentence of {count} words", source.path)
    })
    .collect()
}

fn is_document(source: &Source) -> bool {
    let path = source.path.as_str();
    path.ends_with("README.md") && !path.starts_with("bench/")
        || path.starts_with("docs/") && path.ends_with(".md")
}

#[test]
fn types_are_nouns_and_no_function_is_called_of() {
    let rust = workspace().iter().filter(|source| source.is_rust());
    let found: Vec<String> = rust.flat_map(names).collect();
    crate::demand_none(
        "Name the type after what it holds, and the function after what it does.",
        &found,
    );
}

#[test]
fn sentences_of_documents_are_short() {
    let documents = workspace().iter().filter(|source| is_document(source));
    let found: Vec<String> = documents.flat_map(long_sentences).collect();
    crate::demand_none("Make two sentences of it, or a table.", &found);
}

#[test]
fn participles_and_long_sentences_are_refused() {
    let code =
        "struct Seen;\nenum Seeing {}\nimpl A {\n    pub const fn of() {}\n}\n// struct Told\n";
    assert_eq!(names(&Source::new("shared/a/src/b.rs", code)).len(), 2);
    let words = "word ".repeat(WORDS_MAX);
    let long =
        format!("# Head\n\nShort. A {words}end.\n\n| {words}{words}|\n```\n{words}{words}\n```\n");
    assert_eq!(
        long_sentences(&Source::new("docs/a.md", &long)),
        ["docs/a.md:3: a sentence of 42 words"]
    );
    let right = format!("One sentence. {}end.", "word ".repeat(WORDS_MAX - 1));
    assert!(long_sentences(&Source::new("docs/a.md", &right)).is_empty());
}
