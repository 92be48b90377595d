//! Reads the graph file and the files that it names.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use vigil_blocks::fnv1a;
use vigil_pomdp::{PointBased, Pomdp};
use vigil_robot::FaultTree;
use vigil_robot::learned::ModelError;
use vigil_robot::tree::Node;
use vigil_robot::{Description, RobotModel};

use crate::check;
use crate::locate::{line_of_byte, line_of_key};
use crate::schema::{GraphFile, TreeFile};
use crate::solved;

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
    /// The learned model.
    pub model: RobotModel,
    /// Where it was read from.
    pub model_path: PathBuf,
    /// The decision model.
    pub decision: Pomdp,
    /// Where it was read from.
    pub decision_path: PathBuf,
    /// The policy that was solved beforehand, if `supervisor.policy` is that one.
    pub policy: Option<PointBased>,
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
    let robot = keep(load_robot(&robot_path), &mut problems);
    let tree = keep(load_tree(&tree_path), &mut problems);
    let model = keep(load_model(&model_path, robot.as_ref()), &mut problems);
    let decision = keep(load_decision(&decision_path), &mut problems);
    let at = |key: &str, message| at_key(&path, &text, key, message);
    check::graph(&file, robot.as_ref(), &path, |key, message| {
        problems.push(at(key, message));
    });
    if let Some(model) = model.as_ref().filter(|_| problems.is_empty()) {
        check::alarm(&file, model, |key, message| problems.push(at(key, message)));
    }
    let mut solved = None;
    if let (Some(name), Some(decision)) = (&file.supervisor.policy_file, &decision)
        && problems.is_empty()
    {
        match solved::load(&resolve(&path, name), decision) {
            Ok(loaded) => solved = Some(loaded),
            Err(message) => problems.push(at("supervisor.policy_file", message)),
        }
    }
    let (Some(robot), Some(tree), Some(model), Some(decision), true) =
        (robot, tree, model, decision, problems.is_empty())
    else {
        return Err(SetupError { problems });
    };
    let text = format!("{file:?}{robot:?}");
    let (policy, policy_hash) = solved.unzip();
    let hash = [tree.hash(), model.hash(), decision.hash()]
        .into_iter()
        .chain(policy_hash)
        .fold(fnv1a::hash(fnv1a::BASIS, text.as_bytes()), fnv1a::hash_u64);
    Ok(Setup {
        file,
        path,
        robot,
        robot_path,
        tree,
        model,
        model_path,
        decision,
        decision_path,
        policy,
        hash,
    })
}

/// A problem of the value at `key` of the file `text`.
fn at_key(path: &Path, text: &str, key: &str, message: String) -> Problem {
    Problem {
        file: path.to_path_buf(),
        line: line_of_key(text, key),
        key: key.to_owned(),
        message,
    }
}

/// The value, or its problems among `problems`.
fn keep<T>(result: Result<T, SetupError>, problems: &mut Vec<Problem>) -> Option<T> {
    result.map_err(|e| problems.extend(e.problems)).ok()
}

/// Reads and checks a robot's description.
///
/// # Errors
/// Every problem found, at once.
pub fn load_robot(path: &Path) -> Result<Description, SetupError> {
    let (robot, text) = parse::<Description>(path)?;
    let mut problems = Vec::new();
    check::robot(&robot, |key, message| {
        problems.push(at_key(path, &text, key, message))
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
    let problem = |key: &str, message| at_key(path, &text, key, message);
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

/// Reads a learned model; checks that it is one of `robot`.
///
/// # Errors
/// The first problem found.
pub fn load_model(path: &Path, robot: Option<&Description>) -> Result<RobotModel, SetupError> {
    let problem = |error: ModelError| whole_file(path, error.to_string());
    let model = RobotModel::from_toml(&read(path)?).map_err(problem)?;
    robot.map_or(Ok(()), |robot| model.check_robot(robot).map_err(problem))?;
    Ok(model)
}

/// Reads a decision model.
///
/// # Errors
/// The first problem found.
pub fn load_decision(path: &Path) -> Result<Pomdp, SetupError> {
    let text = read(path)?;
    Pomdp::parse(&text).map_err(|error| {
        Problem {
            file: path.to_path_buf(),
            line: error.at.line,
            key: String::new(),
            message: error.message,
        }
        .into()
    })
}

fn whole_file(path: &Path, message: String) -> Problem {
    Problem {
        file: path.to_path_buf(),
        line: 0,
        key: String::new(),
        message,
    }
}

fn resolve(graph_file: &Path, path: &str) -> PathBuf {
    graph_file
        .parent()
        .unwrap_or_else(|| Path::new("."))
        .join(path)
}

fn read(path: &Path) -> Result<String, Problem> {
    std::fs::read_to_string(path)
        .map_err(|error| whole_file(path, format!("cannot be read: {error}")))
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
