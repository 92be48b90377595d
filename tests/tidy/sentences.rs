//! Sentences of documents and help texts are short.

use vigil_size::Source;

use crate::{sample, workspace};

/// Words of a sentence at most.
const WORDS_MAX: usize = 40;

/// A sentence of running text and its first line.
struct Sentence {
    line: usize,
    words: usize,
}

/// Sentences of running text: no code, no tables, no headings.
fn sentences(text: &str) -> Vec<Sentence> {
    let (mut found, mut is_code) = (Vec::new(), false);
    let mut sentence: Option<Sentence> = None;
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
            let current = sentence.get_or_insert(Sentence {
                line: index + 1,
                words: 0,
            });
            current.words += 1;
            let end = word.trim_end_matches([')', '*', '"']);
            if end.ends_with(['.', ':', ';', '?', '!']) {
                found.extend(sentence.take());
            }
        }
    }
    found.extend(sentence);
    found
}

fn long_sentences(path: &str, first: usize, text: &str) -> Vec<String> {
    let long = sentences(text)
        .into_iter()
        .filter(|one| one.words > WORDS_MAX);
    let say = |one: Sentence| {
        format!(
            "{path}:{}: a sentence of {} words",
            first - 1 + one.line,
            one.words
        )
    };
    long.map(say).collect()
}

/// Of a document, the whole; of a program, the help of its commands and options.
fn violations(source: &Source) -> Vec<String> {
    let path = source.path.as_str();
    let is_document = path.ends_with("README.md") && path != "bench/README.md"
        || path.starts_with("docs/") && path.ends_with(".md")
        || path.ends_with(".help");
    if is_document {
        return long_sentences(path, 1, &source.text);
    }
    let help = source.rust.help.iter();
    help.flat_map(|help| long_sentences(path, help.line, &help.text))
        .collect()
}

#[test]
fn sentences_of_documents_and_help_are_short() {
    let found: Vec<String> = workspace().iter().flat_map(violations).collect();
    crate::demand_none("Make two sentences of it, or a table.", &found);
}

#[test]
fn long_sentences_are_refused() {
    let words = "word ".repeat(WORDS_MAX);
    let long =
        format!("# Head\n\nShort. A {words}end.\n\n| {words}{words}|\n```\n{words}{words}\n```\n");
    let found = violations(&sample("docs/a.md", &long));
    assert_eq!(found, ["docs/a.md:3: a sentence of 42 words"]);
    let right = format!("One sentence. {}end.", "word ".repeat(WORDS_MAX - 1));
    assert!(violations(&sample("docs/a.md", &right)).is_empty());
    let help = format!(
        "/// {words}end.\n#[derive(Args)]\nstruct A {{\n    /// {words}end.\n    \
                        b: u8,\n}}\n/// {words}end.\nstruct C;\n"
    );
    assert_eq!(violations(&sample("shared/a/src/b.rs", &help)).len(), 2);
}
