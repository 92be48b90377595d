//! Reads the graph file and the files that it names.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use vigil_blocks::fnv1a;
use vigil_inference::FaultTree;
use vigil_inference::tree::Node;
use vigil_robot::Description;

use crate::check;
use crate::locate::{line_of_byte, line_of_key};
use crate::schema::{GraphFile, TreeFile};

/// A checked configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The graph file as it was given, options applied.
    pub file: GraphFile,
    /// Where it was read from.
    pub path: PathBuf,
    /// The robot.
    pub robot: Description,
    /// Where it was read from.
    pub robot_path: PathBuf,
    /// The fault tree.
    pub tree: FaultTree,
    /// Text of the learned model (TOML).
    pub model_text: String,
    /// Where it was read from.
    pub model_path: PathBuf,
    /// Text of the decision model (`.pomdp`).
    pub decision_text: String,
    /// Where it was read from.
    pub decision_path: PathBuf,
    /// Hash of the effective configuration and every file it names.
    pub hash: u64,
}

impl Setup {
    /// Resolves a path that the graph file names.
    #[must_use]
    pub fn resolve(&self, path: &str) -> PathBuf {
        resolve(&self.path, path)
    }
}

/// One problem of a configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// File in which it lies.
    pub file: PathBuf,
    /// Line, from 1; 0 if the file as a whole is meant.
    pub line: usize,
    /// Key, or empty.
    pub key: String,
    /// What is wrong and what is allowed.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.message)
    }
}

/// Why a configuration was refused: every problem found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct SetupError {
    /// The problems, in the order of the files.
    pub problems: Vec<Problem>,
}

impl From<Problem> for SetupError {
    fn from(problem: Problem) -> Self {
        Self {
            problems: vec![problem],
        }
    }
}

/// Reads a graph file and the files that it names; `change` may replace values before the check.
///
/// # Errors
/// Every problem found, at once.
pub fn load_graph(path: &Path, change: impl FnOnce(&mut GraphFile)) -> Result<Setup, SetupError> {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let (mut file, text) = parse::<GraphFile>(&path)?;
    change(&mut file);
    let mut problems = Vec::new();
    let robot_path = resolve(&path, &file.files.robot);
    let tree_path = resolve(&path, &file.files.tree);
    let model_path = resolve(&path, &file.files.model);
    let decision_path = resolve(&path, &file.files.decision);
    let mut keep = |result: Result<(), SetupError>| {
        if let Err(error) = result {
            problems.extend(error.problems);
        }
    };
    let robot = load_robot(&robot_path);
    let tree = load_tree(&tree_path);
    let model_text = read(&model_path);
    let decision_text = read(&decision_path);
    keep(robot.as_ref().map(|_| ()).map_err(Clone::clone));
    keep(tree.as_ref().map(|_| ()).map_err(Clone::clone));
    keep(
        model_text
            .as_ref()
            .map(|_| ())
            .map_err(Clone::clone)
            .map_err(SetupError::from),
    );
    keep(
        decision_text
            .as_ref()
            .map(|_| ())
            .map_err(Clone::clone)
            .map_err(SetupError::from),
    );
    check::graph(&file, robot.as_ref().ok(), &path, |key, message| {
        problems.push(Problem {
            file: path.clone(),
            line: line_of_key(&text, key),
            key: key.to_owned(),
            message,
        });
    });
    let (Ok(robot), Ok(tree), Ok(model_text), Ok(decision_text), true) =
        (robot, tree, model_text, decision_text, problems.is_empty())
    else {
        return Err(SetupError { problems });
    };
    let hash = [
        format!("{file:?}{robot:?}"),
        model_text.clone(),
        decision_text.clone(),
    ]
    .iter()
    .fold(fnv1a::hash_u64(fnv1a::BASIS, tree.hash()), |h, t| {
        fnv1a::hash(h, t.as_bytes())
    });
    Ok(Setup {
        file,
        path,
        robot,
        robot_path,
        tree,
        model_text,
        model_path,
        decision_text,
        decision_path,
        hash,
    })
}

/// Reads and checks a robot's description.
///
/// # Errors
/// Every problem found, at once.
pub fn load_robot(path: &Path) -> Result<Description, SetupError> {
    let (robot, text) = parse::<Description>(path)?;
    let mut problems = Vec::new();
    check::robot(&robot, |key, message| {
        problems.push(Problem {
            file: path.to_path_buf(),
            line: line_of_key(&text, key),
            key: key.to_owned(),
            message,
        });
    });
    if problems.is_empty() {
        Ok(robot)
    } else {
        Err(SetupError { problems })
    }
}

/// Reads and checks a fault tree.
///
/// # Errors
/// The first problem found.
pub fn load_tree(path: &Path) -> Result<FaultTree, SetupError> {
    let (file, text) = parse::<TreeFile>(path)?;
    let problem = |key: &str, message: String| Problem {
        file: path.to_path_buf(),
        line: line_of_key(&text, key),
        key: key.to_owned(),
        message,
    };
    let mut nodes = Vec::with_capacity(file.node.len());
    for (i, node) in file.node.iter().enumerate() {
        let parent = match &node.parent {
            None => None,
            Some(name) => Some(file.node.iter().position(|n| n.name == *name).ok_or_else(
                || {
                    problem(
                        &format!("node.{i}.parent"),
                        format!("there is no node '{name}'"),
                    )
                },
            )?),
        };
        nodes.push(Node {
            name: node.name.clone(),
            parent,
            fault: node.fault.clone(),
        });
    }
    FaultTree::new(nodes).map_err(|error| problem("node", error.to_string()).into())
}

fn resolve(graph_file: &Path, path: &str) -> PathBuf {
    graph_file
        .parent()
        .unwrap_or_else(|| Path::new("."))
        .join(path)
}

fn read(path: &Path) -> Result<String, Problem> {
    std::fs::read_to_string(path).map_err(|error| Problem {
        file: path.to_path_buf(),
        line: 0,
        key: String::new(),
        message: format!("cannot be read: {error}"),
    })
}

fn parse<T: DeserializeOwned>(path: &Path) -> Result<(T, String), SetupError> {
    let text = read(path)?;
    let value = toml::from_str(&text).map_err(|error| Problem {
        file: path.to_path_buf(),
        line: error
            .span()
            .map_or(0, |span| line_of_byte(&text, span.start)),
        key: String::new(),
        message: error.message().replace('\n', " "),
    })?;
    Ok((value, text))
}
