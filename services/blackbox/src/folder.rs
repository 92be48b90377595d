//! The folder of a graph's recordings: names, and a bound on their sum.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use vigil_flight::{FlightError, is_being_written};
use vigil_setup::RunningGraph;

/// How a recording ends that is not finished.
const PART: &str = ".mcap.part";
/// How one ends that is being made whole.
const MENDING: &str = ".mcap.mending";
/// How one ends that is.
const WHOLE: &str = ".mcap";
/// How the name of one ends that was cut short, and of one that nothing but missed cycles is the
/// reason of.
const CUT: &str = "-cut";
/// How the name of one ends of which a part is not what was written.
const DAMAGED: &str = "-damaged";
const MISS: &str = "-miss";

/// A graph's folder of recordings, of bounded size. Other files in it are nobody's business here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingsFolder {
    path: PathBuf,
    graph: String,
    bytes_max: u64,
}

impl RecordingsFolder {
    /// That of a graph.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn find(running: &RunningGraph) -> io::Result<Self> {
        let (setup, graph) = (&running.setup, running.domain.graph());
        let settings = &setup.file.blackbox;
        let candidates = settings.folders(&setup.path, graph);
        Self::open(&candidates, graph, settings.folder_bytes())
    }

    /// The first of these folders in which files can be made.
    ///
    /// # Errors
    /// The system's, of the last.
    pub fn open(candidates: &[PathBuf], graph: &str, bytes_max: u64) -> io::Result<Self> {
        let mut result = Err(io::Error::other("no folder for recordings is given"));
        for path in candidates {
            result = writable(path).map(|()| Self {
                path: path.clone(),
                graph: graph.to_owned(),
                bytes_max,
            });
            if result.is_ok() {
                break;
            }
        }
        result
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A new recording's path: graph, time (RFC 3339) and reason.
    pub fn name(&self, rfc3339: &str, reason: &str) -> PathBuf {
        // Colons cannot stand in names everywhere.
        let time: String = rfc3339.chars().filter(|c| !":-".contains(*c)).collect();
        let graph = &self.graph;
        self.path.join(format!("{graph}-{time}-{reason}{WHOLE}"))
    }

    /// Gives recordings a proper name that a process has left unfinished: they can be read as far
    /// as they go.
    pub fn adopt_parts(&self) -> Vec<PathBuf> {
        let parts = self.files(PART).into_iter();
        let left = parts.filter(|part| !is_being_written(&part.path));
        left.filter_map(|part| adopt(&part.path)).collect()
    }

    /// Gives those an end that were cut short, so that every program can open them. What is damaged
    /// stays as it is, under another name. `tell` hears of each.
    pub fn mend_cut(&self, tell: impl Fn(&Path)) {
        for begun in self.files(MENDING) {
            let _ = fs::remove_file(begun.path);
        }
        for file in self.files(&format!("{CUT}{WHOLE}")) {
            let is_whole = vigil_flight::has_end(&file.path).unwrap_or(true);
            if is_whole || is_being_written(&file.path) {
                continue;
            }
            self.prune(file.bytes);
            if let Ok(path) = file.mend() {
                tell(&path);
            }
        }
    }

    /// Removes recordings until the others, and `more` bytes, are within the bound: those that
    /// only missed cycles are the reason of first, the oldest first. The newest stays.
    pub fn prune(&self, more: u64) {
        let mut files = self.files(WHOLE);
        files.sort_by(|a, b| (a.modified, &a.path).cmp(&(b.modified, &b.path)));
        let mut sum = more;
        for file in &files {
            sum = sum.saturating_add(file.bytes);
        }
        files.pop();
        files.sort_by_key(|file| !file.is_of_misses());
        for file in &files {
            if sum <= self.bytes_max {
                break;
            }
            if fs::remove_file(&file.path).is_ok() {
                sum = sum.saturating_sub(file.bytes);
            }
        }
    }

    /// Time since the last recording that only missed cycles are the reason of.
    pub fn since_misses(&self) -> Option<Duration> {
        let files = self.files(WHOLE).into_iter();
        let files = files.filter(RecordingFile::is_of_misses);
        let ages = files.filter_map(|file| file.modified.elapsed().ok());
        ages.min()
    }

    /// The graph's own files that end so.
    fn files(&self, ending: &str) -> Vec<RecordingFile> {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        let begin = format!("{}-", self.graph);
        let files = entries.filter_map(|entry| {
            let (path, metadata) = (entry.path(), entry.metadata().ok()?);
            let name = path.file_name()?.to_str()?;
            // After the graph's name comes the time: `rover-2` has no files of `rover`.
            let time = name.strip_prefix(&begin)?.strip_suffix(ending)?;
            let is_time = time.len() > 20 && time.as_bytes()[..8].iter().all(u8::is_ascii_digit);
            is_time.then_some(RecordingFile {
                bytes: metadata.len(),
                modified: metadata.modified().ok()?,
                path,
            })
        });
        files.collect()
    }
}

/// Gives an unfinished recording a proper name; one without content is removed.
pub fn adopt(part: &Path) -> Option<PathBuf> {
    if fs::metadata(part).is_ok_and(|metadata| metadata.len() == 0) {
        let _ = fs::remove_file(part);
        return None;
    }
    let name = part.file_name()?.to_str()?.strip_suffix(PART)?;
    let cut = part.with_file_name(format!("{name}{CUT}{WHOLE}"));
    fs::rename(part, &cut).ok()?;
    Some(cut)
}

/// Makes the folder, and a file in it for a moment.
fn writable(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let probe = folder.join(format!(".probe-{}", std::process::id()));
    File::create(&probe)?;
    fs::remove_file(probe)
}

struct RecordingFile {
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
}

impl RecordingFile {
    /// Makes it whole, or renames it if it is damaged; it is as old as it was.
    fn mend(&self) -> Result<PathBuf, FlightError> {
        let begun = self.path.with_extension("mcap.mending");
        let mended = vigil_flight::mend(&self.path, &begun)?;
        let unwritten = |source| FlightError::File {
            path: self.path.clone(),
            source,
        };
        if mended.damage.is_some() {
            let _ = fs::remove_file(begun);
            let name = self.path.to_string_lossy();
            let name = name.strip_suffix(&format!("{CUT}{WHOLE}")).unwrap_or(&name);
            let damaged = PathBuf::from(format!("{name}{DAMAGED}{WHOLE}"));
            fs::rename(&self.path, &damaged).map_err(unwritten)?;
            return Ok(damaged);
        }
        let replaced = File::open(&begun)
            .and_then(|file| file.set_modified(self.modified))
            // It may have had to make room meanwhile.
            .and_then(|()| fs::metadata(&self.path))
            .and_then(|_| fs::rename(&begun, &self.path));
        if replaced.is_err() {
            let _ = fs::remove_file(begun);
        }
        replaced.map_err(unwritten)?;
        Ok(self.path.clone())
    }

    fn is_of_misses(&self) -> bool {
        let name = self.path.file_stem().unwrap_or_default();
        let name = name.to_string_lossy();
        let name = name.strip_suffix(CUT).unwrap_or(&name);
        name.strip_suffix(DAMAGED).unwrap_or(name).ends_with(MISS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::{Block, SensorFrame};
    use vigil_cycle::Topic;
    use vigil_flight::{FlightWriter, part_path};
    use vigil_timeline::WallClock;

    fn folder(path: &Path, bytes_max: u64) -> RecordingsFolder {
        RecordingsFolder::open(&[path.to_owned()], "rover", bytes_max).unwrap()
    }

    fn left(folder: &RecordingsFolder) -> Vec<String> {
        let names = fs::read_dir(folder.path()).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn misses_go_first_then_the_oldest_and_the_newest_and_others_files_stay() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = folder(&temporary.path().join("new"), 250);
        let name = |time: &str, reason: &str| {
            let path = folder.name(time, reason);
            path.file_name().unwrap().to_str().unwrap().to_owned()
        };
        let old = name("2026-11-28T10:00:00.000Z", "alarm");
        let miss = name("2026-11-28T11:00:00.000Z", "miss");
        let new = name("2026-11-28T12:00:00.000Z", "crash");
        for (age_s, name) in [
            (40, old.as_str()),
            (30, &miss),
            (10, &new),
            (90, "mine.mcap"),
            (90, "rover-2-20261128T100000.000Z-alarm.mcap"),
        ] {
            let path = folder.path().join(name);
            fs::write(&path, [0; 100]).unwrap();
            let then = SystemTime::now() - Duration::from_secs(age_s);
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(then).unwrap();
        }
        let others = ["mine.mcap", "rover-2-20261128T100000.000Z-alarm.mcap"];
        let with_others = |own: &[&String]| {
            let own = own.iter().map(|name| (*name).clone());
            let mut all: Vec<String> = own.chain(others.map(str::to_owned)).collect();
            all.sort();
            all
        };
        assert!(folder.since_misses().unwrap() >= Duration::from_secs(30));
        folder.prune(0);
        assert_eq!(left(&folder), with_others(&[&old, &new]));
        assert_eq!(folder.since_misses(), None);
        folder.prune(100);
        assert_eq!(left(&folder), with_others(&[&new]));
        folder.prune(1000);
        assert_eq!(left(&folder), with_others(&[&new]), "the newest stays");
    }

    #[test]
    fn what_was_left_unfinished_gets_a_name_that_says_so() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = folder(temporary.path(), 1000);
        let whole = folder.name("2026-11-28T18:00:01.250Z", "alarm");
        let name = "rover-20261128T180001.250Z-alarm";
        assert!(whole.ends_with(format!("{name}.mcap")), "{whole:?}");
        fs::write(part_path(&whole), "x").unwrap();
        let empty = folder.name("2026-11-28T18:00:02.250Z", "alarm");
        fs::write(part_path(&empty), "").unwrap();
        fs::write(folder.path().join("mine.mcap.part"), "x").unwrap();
        let adopted = folder.adopt_parts();
        assert_eq!(adopted, [folder.path().join(format!("{name}-cut.mcap"))]);
        assert_eq!(
            left(&folder),
            ["mine.mcap.part", &format!("{name}-cut.mcap")]
        );
    }

    #[test]
    fn what_was_cut_short_gets_an_end_unless_somebody_writes_it() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = folder(temporary.path(), 1000);
        let whole = folder.name("2026-11-28T18:00:01.250Z", "alarm");
        let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/rover.toml");
        let graph = vigil_setup::load_graph(Path::new(config), |_| {}).unwrap();
        let mut writer = FlightWriter::create(&whole, &graph, WallClock::ahead_by(0)).unwrap();
        assert!(is_being_written(&part_path(&whole)));
        assert!(folder.adopt_parts().is_empty());
        let marked = |second: u64| 1234.5 * second as f64;
        for second in 1..6 {
            let t_ns = second * 1_000_000_000;
            let mut frame = SensorFrame::default();
            frame.header.schema = SensorFrame::SCHEMA;
            frame.header.t_publish_ns = t_ns;
            frame.set_command(0, marked(second));
            writer
                .block(Topic::Sensor, bytemuck::bytes_of(&frame))
                .unwrap();
        }
        writer.finish().unwrap();
        let content = fs::read(&whole).unwrap();
        fs::remove_file(&whole).unwrap();
        fs::write(part_path(&whole), &content[..content.len() - 100]).unwrap();
        let cut = folder.adopt_parts().remove(0);
        let old = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let file = fs::File::options().write(true).open(&cut).unwrap();
        file.set_modified(old).unwrap();
        file.lock().unwrap();
        folder.mend_cut(|_| {});
        assert!(!vigil_flight::has_end(&cut).unwrap(), "somebody writes it");
        drop(file);
        folder.mend_cut(|_| {});
        assert!(vigil_flight::has_end(&cut).unwrap());
        assert_eq!(fs::metadata(&cut).unwrap().modified().unwrap(), old);
        assert_eq!(left(&folder).len(), 1);
        // Of a damaged one nothing is thrown away.
        let mut damaged = content[..content.len() - 100].to_vec();
        let last = marked(5).to_le_bytes();
        let at = damaged.windows(8).position(|bytes| bytes == last).unwrap();
        damaged[at] ^= 1;
        fs::write(&cut, &damaged).unwrap();
        folder.mend_cut(|_| {});
        let [kept] = &left(&folder)[..] else {
            panic!("{:?}", left(&folder));
        };
        assert!(kept.ends_with("-alarm-damaged.mcap"), "{kept}");
        assert_eq!(fs::read(folder.path().join(kept)).unwrap(), damaged);
    }

    #[test]
    fn misses_count_although_their_recording_was_cut_short() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = folder(temporary.path(), 1000);
        let miss = folder.name("2026-11-28T18:00:01.250Z", "miss");
        fs::write(part_path(&miss), "x").unwrap();
        assert_eq!(folder.since_misses(), None);
        folder.adopt_parts();
        assert!(folder.since_misses().is_some());
    }

    #[test]
    fn the_first_folder_that_can_be_written_is_taken() {
        let temporary = tempfile::tempdir().unwrap();
        let here = temporary.path().join("a/b");
        let candidates = ["/proc/none".into(), here.clone()];
        let folder = RecordingsFolder::open(&candidates, "rover", 1).unwrap();
        assert_eq!(folder.path(), here);
        assert!(RecordingsFolder::open(&candidates[..1], "rover", 1).is_err());
    }
}
