//! Where commands run: the project's folder, and folders that look like it.

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use flate2::read::GzDecoder;
use tempfile::TempDir;

/// The project's folder.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The folder of public data; none, and a line that says so, without `VIGIL_DATA`.
pub fn data() -> Option<PathBuf> {
    let data = std::env::var_os("VIGIL_DATA");
    if data.is_none() {
        eprintln!("SKIPPED: VIGIL_DATA is not set");
    }
    data.map(PathBuf::from)
}

/// A folder with the project's configuration.
pub fn workplace() -> TempDir {
    let folder = TempDir::new().unwrap();
    let config = root().join("config").canonicalize().unwrap();
    symlink(config, folder.path().join("config")).unwrap();
    folder
}

/// The same with an unpacked log of the public data.
pub fn workplace_of(log: &str, data: &Path) -> TempDir {
    let folder = workplace();
    let packed = data.join(format!("real/{log}.tar.xz"));
    let mut tar = Command::new("tar");
    tar.arg("-xJf").arg(&packed).arg("-C").arg(folder.path());
    assert!(tar.status().unwrap().success(), "{}", packed.display());
    folder
}

/// The commands of a page, without the program.
pub fn commands(page: &str) -> Vec<Vec<String>> {
    let lines = page.lines();
    let lines = lines.filter_map(|line| line.strip_prefix("target/release/vigil "));
    let words = |line: &str| line.split(' ').map(str::to_owned).collect();
    lines.map(words).collect()
}

/// Rows of a packed table of frames that `keep` wants, by run and time, as a plain table.
pub fn cut(from: &Path, to: &Path, keep: impl Fn(u32, f64) -> bool) {
    let mut text = String::new();
    let file = File::open(from).unwrap();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let mut lines = text.lines();
    let mut kept = vec![lines.next().unwrap()];
    kept.extend(lines.filter(|line| {
        let mut fields = line.split(',');
        let run = fields.next().unwrap().parse().unwrap();
        keep(run, fields.next().unwrap().parse().unwrap())
    }));
    fs::write(to, kept.join("\n")).unwrap();
}
