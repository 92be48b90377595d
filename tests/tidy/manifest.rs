//! Reads what the checks need from a `Cargo.toml`.

use crate::mask::mask_toml;

/// A crate of the workspace.
#[derive(Debug, PartialEq, Eq)]
pub struct Manifest {
    /// Path of the manifest from the workspace's root.
    pub path: String,
    /// Name of the package.
    pub package: String,
    /// Packages it depends on, for single targets and its build too; its tests may see everything.
    pub dependencies: Vec<String>,
    /// True if it takes the workspace's lints.
    pub has_workspace_lints: bool,
}

impl Manifest {
    /// Reads the text of the manifest at `path`.
    pub fn read(path: &str, text: &str) -> Self {
        let mut manifest = Self {
            path: path.to_string(),
            package: String::new(),
            dependencies: Vec::new(),
            has_workspace_lints: false,
        };
        let mut section = String::new();
        for (line, masked) in text.lines().zip(mask_toml(text).lines()) {
            if let Some(header) = masked.trim().strip_prefix('[') {
                section = header.trim_end_matches(']').trim().to_string();
                manifest
                    .dependencies
                    .extend(table_dependency(&section).map(str::to_string));
                continue;
            }
            let Some((key, _)) = masked.split_once('=') else {
                continue;
            };
            let value = line.split_once('=').map_or("", |(_, value)| value).trim();
            manifest.take(&section, key.trim(), value);
        }
        manifest
    }

    fn take(&mut self, section: &str, key: &str, value: &str) {
        match (section, key) {
            ("package", "name") => self.package = unquoted(value).to_string(),
            ("lints", "workspace") => self.has_workspace_lints = value == "true",
            _ if is_dependencies(section) => {
                let name = key.split('.').next().unwrap_or_default();
                self.dependencies
                    .push(renamed(value).unwrap_or(name).to_string());
            }
            _ if table_dependency(section).is_some() && key == "package" => {
                self.dependencies.push(unquoted(value).to_string());
            }
            _ => {}
        }
    }
}

fn is_dependencies(section: &str) -> bool {
    let last = section.rsplit('.').next().unwrap_or_default();
    matches!(last, "dependencies" | "build-dependencies") && !section.starts_with("workspace")
}

/// The package of a section such as `dependencies.name`.
fn table_dependency(section: &str) -> Option<&str> {
    let (parent, name) = section.rsplit_once('.')?;
    is_dependencies(parent).then_some(name)
}

/// The package behind `{ package = "name", .. }`.
fn renamed(value: &str) -> Option<&str> {
    let (_, tail) = value.split_once("package")?;
    let (_, tail) = tail.split_once('"')?;
    tail.split('"').next()
}

fn unquoted(value: &str) -> &str {
    value.split('"').nth(1).unwrap_or(value)
}

#[test]
fn every_way_to_write_a_dependency_is_read() {
    let text = "[package]\nname = \"vigil-robot\" # ours\n[lints]\nworkspace = true\n\
                [dependencies]\na.workspace = true\nb = \"1\"\nc = { package = \"vigil-cycle\" }\n\
                [dev-dependencies.d]\nversion = \"1\"\n[target.'cfg(unix)'.dependencies]\n\
                e = { version = \"1\" }\n[build-dependencies]\n# no = \"1\"\nf = \"2\"\n\
                [dependencies.g]\npackage = \"libc\"\n[features]\nh = []\n";
    let manifest = Manifest::read("shared/robot/Cargo.toml", text);
    assert_eq!(manifest.package, "vigil-robot");
    assert!(manifest.has_workspace_lints);
    assert_eq!(
        manifest.dependencies,
        ["a", "b", "vigil-cycle", "e", "f", "g", "libc"]
    );
}
