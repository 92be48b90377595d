//! Dependencies between crates point one way.

use toml::{Table, Value};
use vigil_size::Source;

use crate::workspace;

/// A crate of the workspace.
struct Manifest {
    /// Path of the manifest from the workspace's root.
    path: String,
    /// Name of the package.
    package: String,
    /// Packages it depends on, for single targets and its build too; its tests may see everything.
    dependencies: Vec<String>,
    /// True if it takes the workspace's lints.
    has_workspace_lints: bool,
}

impl Manifest {
    fn read(path: &str, text: &str) -> Self {
        let table: Table = toml::from_str(text).unwrap();
        let targets = table
            .get("target")
            .and_then(Value::as_table)
            .into_iter()
            .flatten();
        let targets = targets.filter_map(|(_, target)| target.as_table());
        let lints = table.get("lints").and_then(|lints| lints.get("workspace"));
        Self {
            path: path.to_owned(),
            package: table["package"]["name"].as_str().unwrap().to_owned(),
            dependencies: [&table]
                .into_iter()
                .chain(targets)
                .flat_map(dependencies)
                .collect(),
            has_workspace_lints: lints.and_then(Value::as_bool) == Some(true),
        }
    }
}

/// The packages behind the names of a manifest's, or one of its targets', dependencies.
fn dependencies(table: &Table) -> Vec<String> {
    let tables = ["dependencies", "build-dependencies"].into_iter();
    let tables = tables.filter_map(|name| table.get(name)?.as_table());
    let package = |(name, of): (&String, &Value)| {
        let renamed = of.get("package").and_then(Value::as_str);
        renamed.unwrap_or(name).to_owned()
    };
    tables.flat_map(|table| table.iter().map(package)).collect()
}

const SHARED: &[&str] = &[
    "vigil-flight",
    "vigil-timeline",
    "vigil-setup",
    "vigil-cycle",
    "vigil-recording",
    "vigil-robot",
    "vigil-inference",
    "vigil-decision",
    "vigil-diagnosis",
    "vigil-pomdp",
    "vigil-blocks",
    "vigil-checkpoint",
    "vigil-checkpoint-derive",
];

/// The services whose `step` others may run offline.
const SERVICES: &[&str] = &[
    "vigil-sensor-sim",
    "vigil-detector",
    "vigil-identifier",
    "vigil-supervisor",
];

/// The tools, in order: each sees those before it.
const TOOLS: &[&str] = &[
    "vigil-terminal",
    "vigil-pages",
    "vigil-flight-page",
    "vigil-learning",
    "vigil-evaluation",
    "vigil-import",
    "vigil-missions",
    "vigil-replay",
    "vigil-lab",
    "vigil-ros2",
    "vigil",
];

/// The tools that the door may link: it starts the others.
/// The launcher is for its options, the black box for the form of what it says.
const OF_THE_DOOR: &[&str] = &["vigil-terminal", "vigil-launcher", "vigil-blackbox"];

/// For each shared crate, the crates of the workspace that it may see.
const ALLOWED: &[(&str, &[&str])] = &[
    ("vigil-checkpoint-derive", &[]),
    ("vigil-checkpoint", &["vigil-checkpoint-derive"]),
    ("vigil-blocks", &["vigil-checkpoint"]),
    ("vigil-inference", &["vigil-checkpoint"]),
    ("vigil-pomdp", &[]),
    ("vigil-cycle", &["vigil-blocks", "vigil-checkpoint"]),
    (
        "vigil-robot",
        &["vigil-inference", "vigil-blocks", "vigil-checkpoint"],
    ),
    (
        "vigil-diagnosis",
        &[
            "vigil-robot",
            "vigil-inference",
            "vigil-blocks",
            "vigil-checkpoint",
        ],
    ),
    (
        "vigil-decision",
        &[
            "vigil-pomdp",
            "vigil-robot",
            "vigil-blocks",
            "vigil-checkpoint",
        ],
    ),
    // Setup reads every model that a graph names, and turns the configuration into what the cycle
    // needs: placement, deadlines, queues.
    (
        "vigil-setup",
        &[
            "vigil-cycle",
            "vigil-decision",
            "vigil-diagnosis",
            "vigil-pomdp",
            "vigil-robot",
            "vigil-inference",
            "vigil-blocks",
        ],
    ),
    (
        "vigil-timeline",
        &["vigil-setup", "vigil-cycle", "vigil-robot", "vigil-blocks"],
    ),
    (
        "vigil-flight",
        &[
            "vigil-timeline",
            "vigil-setup",
            "vigil-cycle",
            "vigil-robot",
            "vigil-blocks",
        ],
    ),
    (
        "vigil-recording",
        &["vigil-robot", "vigil-inference", "vigil-blocks"],
    ),
];

/// Crates that compute only: no transport, no clock, no system call.
const PURE: &[&str] = &[
    "vigil-checkpoint",
    "vigil-blocks",
    "vigil-inference",
    "vigil-pomdp",
    "vigil-robot",
    "vigil-diagnosis",
    "vigil-decision",
];

/// What a pure crate never sees.
const SYSTEM: &[&str] = &[
    "iceoryx2",
    "libc",
    "rustix",
    "nix",
    "core_affinity",
    "signal-hook",
];

fn allowed(manifest: &Manifest) -> Option<Vec<&'static str>> {
    let package = manifest.package.as_str();
    if let Some((_, shared)) = ALLOWED.iter().find(|(name, _)| *name == package) {
        return Some(shared.to_vec());
    }
    if package == "vigil" {
        return Some([SHARED, SERVICES, OF_THE_DOOR].concat());
    }
    if let Some(at) = TOOLS.iter().position(|tool| *tool == package) {
        return Some([SHARED, SERVICES, &TOOLS[..at]].concat());
    }
    // The measuring program and the tests stand outside; both count lines.
    if ["vigil-bench", "vigil-tests", "vigil-size"].contains(&package) {
        return Some([SHARED, SERVICES, TOOLS, &["vigil-size"]].concat());
    }
    // Publishers to begin with use what a robot's program would use.
    if package == "vigil-examples" {
        return Some(SHARED.to_vec());
    }
    // Bindings of a library, and what simulates its models.
    if package == "vigil-pomdp-python" {
        return Some(vec!["vigil-pomdp", "vigil-missions"]);
    }
    // Fuzzing of a shared crate, outside the workspace.
    if is_fuzzing(manifest) {
        return Some(SHARED.to_vec());
    }
    manifest
        .path
        .starts_with("services/")
        .then(|| SHARED.to_vec())
}

/// Fuzz targets need another compiler than the workspace, and are no part of it.
fn is_fuzzing(manifest: &Manifest) -> bool {
    manifest.path.ends_with("/fuzz/Cargo.toml")
}

fn arrow_violations(manifests: &[Manifest]) -> Vec<String> {
    let ours = |name: &str| manifests.iter().any(|manifest| manifest.package == name);
    let mut found = Vec::new();
    for manifest in manifests {
        let (path, package) = (&manifest.path, &manifest.package);
        let Some(allowed) = allowed(manifest) else {
            found.push(format!(
                "{path}: '{package}' has no place in the table of arrows"
            ));
            continue;
        };
        let pure = PURE.contains(&package.as_str());
        for dependency in &manifest.dependencies {
            // Tests of a crate may name the crate itself.
            if ours(dependency) && dependency != package && !allowed.contains(&dependency.as_str())
            {
                let list = allowed.join(", ");
                found.push(format!("{path}: depends on {dependency}; allowed: {list}"));
            }
            if pure && SYSTEM.iter().any(|system| dependency.starts_with(system)) {
                found.push(format!(
                    "{path}: {package} only computes; it cannot use {dependency}"
                ));
            }
        }
    }
    found
}

fn lint_violations(manifests: &[Manifest]) -> Vec<String> {
    let lax = manifests
        .iter()
        .filter(|manifest| !manifest.has_workspace_lints && !is_fuzzing(manifest));
    lax.map(|manifest| format!("{}: no `[lints] workspace = true`", manifest.path))
        .collect()
}

fn manifests(sources: &[Source]) -> Vec<Manifest> {
    sources
        .iter()
        .filter(|source| source.path.ends_with("/Cargo.toml"))
        .map(|source| Manifest::read(&source.path, &source.text))
        .collect()
}

#[test]
fn arrows_between_crates_point_one_way() {
    let manifests = manifests(workspace());
    assert!(manifests.len() >= SHARED.len() + SERVICES.len() + TOOLS.len());
    crate::demand_none(
        "Move what you need to the room that may hold it, or pass it in as data: services -> \
         {setup, cycle, recording} -> robot -> inference -> blocks, \
         setup -> cycle, pomdp; tools -> services, shared.",
        &arrow_violations(&manifests),
    );
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace() {
    crate::demand_none(
        "Add `[lints] workspace = true` to the crate's manifest.",
        &lint_violations(&manifests(workspace())),
    );
}

#[test]
fn wrong_arrows_are_refused() {
    let read = |path: &str, name: &str, dependencies: &[&str]| {
        let lines: String = dependencies
            .iter()
            .map(|d| format!("{d}.workspace = true\n"))
            .collect();
        let text = format!("[package]\nname = \"{name}\"\n[dependencies]\n{lines}");
        Manifest::read(path, &text)
    };
    let blocks = read("shared/blocks/Cargo.toml", "vigil-blocks", &["bytemuck"]);
    let cycle = read(
        "shared/cycle/Cargo.toml",
        "vigil-cycle",
        &["vigil-blocks", "libc"],
    );
    let good = [blocks, cycle];
    assert_eq!(arrow_violations(&good), Vec::<String>::new());
    assert_eq!(lint_violations(&good).len(), 2);

    let [blocks, cycle] = good;
    let bad = [
        blocks,
        cycle,
        read(
            "shared/inference/Cargo.toml",
            "vigil-inference",
            &["vigil-cycle"],
        ),
        read(
            "shared/robot/Cargo.toml",
            "vigil-robot",
            &["iceoryx2-bb-posix", "vigil-blocks"],
        ),
        read("shared/misc/Cargo.toml", "vigil-misc", &[]),
        read(
            "services/detector/Cargo.toml",
            "vigil-detector",
            &["vigil-cycle"],
        ),
        read(
            "services/supervisor/Cargo.toml",
            "vigil-supervisor",
            &["vigil-detector"],
        ),
        read("tools/vigil/Cargo.toml", "vigil", &["vigil-detector"]),
        read("tools/pages/Cargo.toml", "vigil-pages", &["vigil"]),
        read(
            "services/detector/Cargo.toml",
            "vigil-detector",
            &["vigil-pages"],
        ),
    ];
    let found = arrow_violations(&bad);
    let at: Vec<&str> = found
        .iter()
        .map(|line| line.split('/').nth(1).unwrap())
        .collect();
    assert_eq!(
        at,
        [
            "inference",
            "robot",
            "misc",
            "supervisor",
            "pages",
            "detector"
        ],
        "{found:?}"
    );
}
