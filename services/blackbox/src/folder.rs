//! The folder of the recordings: names, and a bound on their sum.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::SystemTime;

/// How a recording ends that is not finished.
const PART: &str = "part";
/// How one ends that is.
const WHOLE: &str = "mcap";

/// A folder of recordings of bounded size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingsFolder {
    path: PathBuf,
    bytes_max: u64,
}

impl RecordingsFolder {
    /// The folder at `path`, made if it is not there.
    ///
    /// # Errors
    /// The system's.
    pub fn open(path: PathBuf, bytes_max: u64) -> io::Result<Self> {
        fs::create_dir_all(&path)?;
        Ok(Self { path, bytes_max })
    }

    /// A new recording's path: graph, time (RFC 3339) and reason.
    pub fn name(&self, graph: &str, rfc3339: &str, reason: &str) -> PathBuf {
        // Colons cannot stand in names everywhere.
        let time: String = rfc3339.chars().filter(|c| !":-".contains(*c)).collect();
        self.path.join(format!("{graph}-{time}-{reason}.{WHOLE}"))
    }

    /// Gives recordings a proper name that a process has left unfinished: they can be read as far
    /// as they go.
    pub fn adopt_parts(&self) -> Vec<PathBuf> {
        let parts = self.files(PART).into_iter().filter_map(|file| {
            let whole = file.path.with_extension("");
            let stem = whole.file_stem()?.to_str()?;
            let cut = whole.with_file_name(format!("{stem}-cut.{WHOLE}"));
            fs::rename(&file.path, &cut).ok()?;
            Some(cut)
        });
        parts.collect()
    }

    /// Removes the oldest recordings until the others, and `more` bytes, are within the bound.
    pub fn prune(&self, more: u64) {
        let mut files = self.files(WHOLE);
        files.sort_by(|a, b| (a.modified, &a.path).cmp(&(b.modified, &b.path)));
        let mut sum = files.iter().map(|file| file.bytes).sum::<u64>() + more;
        for file in &files {
            if sum <= self.bytes_max {
                break;
            }
            if fs::remove_file(&file.path).is_ok() {
                sum -= file.bytes;
            }
        }
    }

    fn files(&self, extension: &str) -> Vec<RecordingFile> {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        let files = entries.filter_map(|entry| {
            let (path, metadata) = (entry.path(), entry.metadata().ok()?);
            let is_kind = path.extension().is_some_and(|of| of == extension);
            is_kind.then_some(RecordingFile {
                path,
                bytes: metadata.len(),
                modified: metadata.modified().ok()?,
            })
        });
        files.collect()
    }
}

struct RecordingFile {
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_oldest_recordings_go_until_the_sum_is_within_the_bound() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = RecordingsFolder::open(temporary.path().join("new"), 250).unwrap();
        for (age_s, name) in [
            (30, "b.mcap"),
            (40, "a.mcap"),
            (10, "c.mcap"),
            (90, "other"),
        ] {
            let path = folder.path.join(name);
            fs::write(&path, [0; 100]).unwrap();
            let then = SystemTime::now() - Duration::from_secs(age_s);
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(then).unwrap();
        }
        let left = || {
            let names = fs::read_dir(&folder.path).unwrap();
            let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            let mut names: Vec<String> = names.collect();
            names.sort();
            names
        };
        folder.prune(0);
        assert_eq!(left(), ["b.mcap", "c.mcap", "other"]);
        folder.prune(100);
        assert_eq!(left(), ["c.mcap", "other"]);
    }

    #[test]
    fn what_was_left_unfinished_gets_a_name_that_says_so() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = RecordingsFolder::open(temporary.path().to_owned(), 1000).unwrap();
        let name = folder.name("rover", "2026-11-28T18:00:01.250Z", "alarm");
        assert!(
            name.ends_with("rover-20261128T180001.250Z-alarm.mcap"),
            "{name:?}"
        );
        let mut part = name.clone().into_os_string();
        part.push(".part");
        fs::write(part, "x").unwrap();
        let adopted = folder.adopt_parts();
        assert!(adopted[0].ends_with("rover-20261128T180001.250Z-alarm-cut.mcap"));
        assert!(adopted[0].exists() && folder.adopt_parts().is_empty());
    }
}
