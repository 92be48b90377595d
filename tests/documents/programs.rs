//! The programs that documents name, as this build has them.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Mutex;

use crate::built::{self, root};

/// The program that a document's word stands for; `None` if it is none of Vigil's.
pub fn program(word: &str) -> Option<PathBuf> {
    match word {
        // All that this script does but build and say where the default graph is.
        "scripts/up" => Some(built::program("vigil-launcher")),
        "scripts/bench" => Some(built::program("vigil-bench")),
        "vigil" => Some(built::program("vigil")),
        _ => Some(built::program(word.strip_prefix("target/release/")?)),
    }
}

/// What `program WORDS --help` prints; `None` if it refuses the words. Asked once for each.
fn help(program: &str, words: &[&str]) -> Option<String> {
    static ASKED: Mutex<BTreeMap<String, Option<String>>> = Mutex::new(BTreeMap::new());
    let key = format!("{program} {}", words.join(" "));
    let mut asked = ASKED.lock().unwrap();
    let answer = asked.entry(key).or_insert_with(|| {
        let mut command = Command::new(self::program(program)?);
        let output = command.args(words).arg("--help").output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        output.status.success().then_some(text)
    });
    answer.clone()
}

/// Options in a command of a document that its program does not have, and commands that it does
/// not have.
pub fn unknown_words(command: &str) -> Vec<String> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let Some((program, words)) = words.split_first() else {
        return Vec::new();
    };
    let names = |word: &&&str| word.starts_with(|c: char| c.is_ascii_lowercase());
    let text = match *program {
        "scripts/up" => std::fs::read_to_string(root().join("scripts/up.help")).ok(),
        // A program of its own, without options that a document names.
        "scripts/bench" if words.first() == Some(&"size") => return Vec::new(),
        "scripts/bench" | "vigil" | "target/release/vigil" => {
            let depth = if words.first() == Some(&"pomdp") {
                2
            } else {
                1
            };
            let path: Vec<&str> = words
                .iter()
                .take(depth)
                .take_while(names)
                .copied()
                .collect();
            help(program, &path)
        }
        _ => return Vec::new(),
    };
    let Some(text) = text else {
        return vec![format!("`{command}`: no such command")];
    };
    let ends = |c: char| c.is_whitespace() || ",=[]<>`.".contains(c);
    let known: Vec<&str> = text.split(ends).collect();
    let options = words.iter().filter(|word| word.starts_with("--"));
    let names = options.map(|option| option.split('=').next().unwrap_or_default());
    let unknown = names.filter(|name| !known.contains(name));
    unknown
        .map(|name| format!("`{command}`: no option {name}"))
        .collect()
}

#[test]
fn words_that_no_program_knows_are_found() {
    assert_eq!(unknown_words("scripts/up --duration 1"), [""; 0]);
    assert_eq!(unknown_words("scripts/up --durations 1").len(), 1);
    assert_eq!(unknown_words("vigil pomdp solve F --method fib"), [""; 0]);
    assert_eq!(unknown_words("vigil pomdp solve F --methods fib").len(), 1);
    assert_eq!(unknown_words("vigil pomdp dissolve F").len(), 1);
    assert_eq!(unknown_words("vigil learns --frames F").len(), 1);
}
