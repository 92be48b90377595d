//! From what was read to a checked configuration.

use std::path::{Path, PathBuf};

use vigil_blocks::fnv1a;
use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::{PointBased, Pomdp};
use vigil_robot::FaultTree;
use vigil_robot::channel_model;
use vigil_robot::learned::ModelError;
use vigil_robot::tree::{Node, TreeError};
use vigil_robot::{Description, RobotModel};

use crate::border::Border;
use crate::document::{Document, TextFile, resolve};
use crate::graph_file::{GraphFile, TreeFile};
use crate::problem::{Problem, SetupError};
use crate::schema::{schema, schema_of};
use crate::{check, hash, ranges};

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

/// Reads a graph file and the files that it names; `change` may replace values before the check.
///
/// # Errors
/// Every problem found, at once.
pub fn load_graph(path: &Path, change: impl FnOnce(&mut GraphFile)) -> Result<Setup, SetupError> {
    Document::read(path, change)?.check()
}

impl Document {
    /// Checks what publishers meet: graph file and robot. Models may be missing.
    ///
    /// # Errors
    /// Every problem found, at once.
    pub fn border(&self) -> Result<Border, SetupError> {
        self.checked_border()
            .map_err(|error| self.blame_options(error))
    }

    fn checked_border(&self) -> Result<Border, SetupError> {
        let mut problems = Vec::new();
        let robot = keep(robot(&self.robot), &mut problems);
        self.check_graph(robot.as_ref(), &mut problems)?;
        match (robot, problems.is_empty()) {
            (Some(robot), true) => Ok(Border {
                file: self.file.clone(),
                path: self.graph.path.clone(),
                robot,
            }),
            _ => Err(SetupError { problems }),
        }
    }

    /// Adds the problems of the graph file to `problems`.
    fn check_graph(
        &self,
        robot: Option<&Description>,
        problems: &mut Vec<Problem>,
    ) -> Result<(), SetupError> {
        let (file, path) = (&self.file, &self.graph.path);
        let text = self.graph.text()?;
        let mut report = |key: &str, message| {
            problems.push(Problem::at_key(path, text, key, message));
        };
        ranges::check_all(&schema(), file, &mut report);
        check::graph(file, robot, path, report);
        Ok(())
    }

    /// Checks everything: each file, each value against its range, and what spans rooms.
    ///
    /// # Errors
    /// Every problem found, at once.
    pub fn check(&self) -> Result<Setup, SetupError> {
        self.checked().map_err(|error| self.blame_options(error))
    }

    fn checked(&self) -> Result<Setup, SetupError> {
        let (file, path) = (&self.file, &self.graph.path);
        let mut problems = Vec::new();
        let robot = keep(robot(&self.robot), &mut problems);
        let tree = keep(tree(&self.tree), &mut problems);
        let model = keep(model(&self.model, robot.as_ref()), &mut problems);
        let tree = match (tree, &model, &robot) {
            (Some(tree), Some(RobotModel::Channels(_)), Some(robot)) => {
                keep(completed(tree, robot, &self.tree), &mut problems)
            }
            (tree, ..) => tree,
        };
        let decision = keep(decision(&self.decision), &mut problems);
        let text = self.graph.text()?;
        let at = |key: &str, message| Problem::at_key(path, text, key, message);
        self.check_graph(robot.as_ref(), &mut problems)?;
        if let (Some(model), Some(robot), true) = (&model, &robot, problems.is_empty()) {
            check::alarm(file, (model, robot), |key, message| {
                problems.push(at(key, message))
            });
        }
        let mut solved = None;
        if let (Some(policy), Some(decision)) = (&self.policy, &decision)
            && problems.is_empty()
        {
            match solved_policy(policy, decision) {
                Ok(policy) => solved = Some(policy),
                Err(message) => problems.push(at("supervisor.policy_file", message)),
            }
        }
        if let (Some(decision), true) = (&decision, problems.is_empty()) {
            let solved = solved.as_ref().map(|(policy, _)| policy);
            check::planning(file, decision, solved, |key, message| {
                problems.push(at(key, message));
            });
        }
        let (Some(robot), Some(tree), Some(model), Some(decision), true) =
            (robot, tree, model, decision, problems.is_empty())
        else {
            return Err(SetupError { problems });
        };
        let unwritable = |error: serde_json::Error| Problem::at_line(path, 0, error.to_string());
        let values = hash::canonical(fnv1a::BASIS, file)
            .and_then(|values| hash::canonical(values, &robot))
            .map_err(unwritable)?;
        let (policy, policy_hash) = solved.unzip();
        let hash = [tree.hash(), model.hash(), decision.hash()]
            .into_iter()
            .chain(policy_hash)
            .fold(values, fnv1a::hash_u64);
        Ok(Setup {
            file: file.clone(),
            path: path.clone(),
            robot,
            robot_path: self.robot.path.clone(),
            tree,
            model,
            model_path: self.model.path.clone(),
            decision,
            decision_path: self.decision.path.clone(),
            policy,
            hash,
        })
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
    robot(&TextFile::read(path.to_path_buf()))
}

fn robot(file: &TextFile) -> Result<Description, SetupError> {
    let robot: Description = file.parse()?;
    let text = file.text()?;
    let mut problems = Vec::new();
    let mut report = |key: &str, message| {
        problems.push(Problem::at_key(&file.path, text, key, message));
    };
    ranges::check_all(&schema_of::<Description>(), &robot, &mut report);
    check::robot(&robot, report);
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
    tree(&TextFile::read(path.to_path_buf()))
}

fn tree(file: &TextFile) -> Result<FaultTree, SetupError> {
    let TreeFile { node: given } = file.parse()?;
    let text = file.text()?;
    let problem = |key: &str, message| Problem::at_key(&file.path, text, key, message);
    let mut nodes = Vec::with_capacity(given.len());
    for (i, node) in given.iter().enumerate() {
        let position = |name: &String| {
            let found = given.iter().position(|other| other.name == *name);
            found.ok_or_else(|| {
                let known: Vec<&str> = given.iter().map(|node| node.name.as_str()).collect();
                let message = format!("there is no node '{name}'; known: {}", known.join(", "));
                problem(&format!("node.{i}.parent"), message)
            })
        };
        nodes.push(Node {
            name: node.name.clone(),
            parent: node.parent.as_ref().map(position).transpose()?,
            fault: node.fault.clone(),
        });
    }
    FaultTree::new(nodes).map_err(|error| problem("node", error.to_string()).into())
}

/// A tree without a leaf becomes the one that follows from the robot's description.
fn completed(
    tree: FaultTree,
    robot: &Description,
    file: &TextFile,
) -> Result<FaultTree, SetupError> {
    if tree.leaves().next().is_some() {
        return Ok(tree);
    }
    let problem = |error: TreeError| Problem::at_line(&file.path, 0, error.to_string());
    Ok(channel_model::tree::tree(robot).map_err(problem)?)
}

/// Reads a learned model; checks that it is one of `robot`.
///
/// # Errors
/// The first problem found.
pub fn load_model(path: &Path, robot: Option<&Description>) -> Result<RobotModel, SetupError> {
    model(&TextFile::read(path.to_path_buf()), robot)
}

fn model(file: &TextFile, robot: Option<&Description>) -> Result<RobotModel, SetupError> {
    let problem = |error: ModelError| Problem::at_line(&file.path, 0, error.to_string());
    let model = RobotModel::from_toml(file.text()?).map_err(problem)?;
    robot.map_or(Ok(()), |robot| model.check_robot(robot).map_err(problem))?;
    Ok(model)
}

/// Reads a decision model.
///
/// # Errors
/// The first problem found.
pub fn load_decision(path: &Path) -> Result<Pomdp, SetupError> {
    decision(&TextFile::read(path.to_path_buf()))
}

fn decision(file: &TextFile) -> Result<Pomdp, SetupError> {
    let problem = |line, message| Problem::at_line(&file.path, line, message);
    let model = Pomdp::parse(file.text()?);
    Ok(model.map_err(|error| problem(error.at.line, error.message))?)
}

/// The policy of `model` in a file, and the hash of the file's bytes; or what is wrong with it.
fn solved_policy(file: &TextFile, model: &Pomdp) -> Result<(PointBased, u64), String> {
    let name = file.path.display();
    let bytes = file
        .text()
        .map_err(|problem| problem.to_string())?
        .as_bytes();
    let read = PolicyFile::read(bytes, model).map_err(|error| format!("{name}: {error}"))?;
    let policy = PointBased::new(model, &read.vectors).map_err(|e| format!("{name}: {e}"))?;
    let (products, states) = (policy.products(), model.states().len());
    if products > PointBased::PRODUCTS_MAX {
        return Err(format!(
            "{name}: a decision with its vectors and those that give every action a value, {} in \
             all, of {states} values each, takes {products} multiplications, allowed are {}: solve \
             with a larger --precision or a shorter --timeout",
            products / states,
            PointBased::PRODUCTS_MAX
        ));
    }
    Ok((policy, fnv1a::hash(fnv1a::BASIS, bytes)))
}
