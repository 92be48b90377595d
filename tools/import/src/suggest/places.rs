//! Where the runs of a log are: which files belong together.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::ImportError;
use crate::survey::{children, is_bag, no_log, tables_below};

/// The runs of a log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Places {
    /// The log's folder.
    pub folder: PathBuf,
    /// Patterns of its runs.
    pub runs: Vec<String>,
    /// `file` of each source; one without a name if a run is a file.
    pub files: Vec<Option<String>>,
    /// What each run is read from: one recording, or a file for each source.
    pub found: Vec<Vec<PathBuf>>,
    /// True if the runs are recordings of ROS 2.
    pub is_bag: bool,
    /// Files that fit no run.
    pub others: usize,
}

/// Finds the runs below `path`.
///
/// # Errors
/// A folder that cannot be listed, or holds no log.
pub(super) fn places(path: &Path) -> Result<Places, ImportError> {
    let folder = parent(path).to_path_buf();
    let name = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let whole = |is_bag| Places {
        folder: folder.clone(),
        runs: vec![name(path)],
        files: vec![None],
        found: vec![vec![path.to_owned()]],
        is_bag,
        others: 0,
    };
    if path.is_file() {
        return Ok(whole(is_bag(path)));
    }
    let own = children(path)?;
    let is_rosbag2 = |folder: &Path| {
        let files = children(folder).unwrap_or_default();
        let has_bag = files.iter().any(|file| is_bag(file));
        has_bag && files.iter().any(|file| name(file) == "metadata.yaml")
    };
    if is_rosbag2(path) {
        return Ok(whole(true));
    }
    let bags: Vec<PathBuf> = own
        .iter()
        .filter(|p| is_bag(p) || is_rosbag2(p))
        .cloned()
        .collect();
    if !bags.is_empty() {
        return Ok(Places {
            folder: path.to_owned(),
            runs: bags.iter().map(|bag| name(bag)).collect(),
            files: vec![None],
            found: bags.into_iter().map(|bag| vec![bag]).collect(),
            is_bag: true,
            others: 0,
        });
    }
    let files = tables_below(path)?;
    let all: usize = files.values().map(Vec::len).sum();
    let group = numbered(&files).or_else(|| named(&files));
    let Some((folders, stems, numbers)) = group else {
        return Err(no_log(path));
    };
    Ok(group_places(path, (folders, stems, numbers), all))
}

/// The folder that a path is in.
fn parent(path: &Path) -> &Path {
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

/// Folders, the patterns of files in each, and the numbers of each folder's runs.
type Group = (Vec<PathBuf>, Vec<String>, Vec<Vec<String>>);

/// A name with `*` for its last number, and the number.
fn stem(name: &str) -> Option<(String, String)> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let (head, tail) = name.split_at_checked(end)?;
    let digits = head.bytes().rev().take_while(u8::is_ascii_digit).count();
    let (before, number) = head.split_at_checked(head.len() - digits)?;
    Some((format!("{before}*{tail}"), number.to_owned()))
}

/// Runs as numbered files: `exp00.csv`, or `pro_00.csv` with `imu_00.csv`. The largest group of
/// folders with the same names counts.
fn numbered(files: &BTreeMap<PathBuf, Vec<String>>) -> Option<Group> {
    let mut groups: BTreeMap<Vec<String>, Vec<(PathBuf, Vec<String>)>> = BTreeMap::new();
    for (folder, names) in files {
        let mut numbers: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (stem, number) in names.iter().filter_map(|name| stem(name)) {
            numbers.entry(stem).or_default().push(number);
        }
        let most = numbers
            .values()
            .max_by_key(|numbers| numbers.len())
            .cloned();
        let Some(most) = most.filter(|most| most.len() > 1) else {
            continue;
        };
        let same = numbers.iter().filter(|(_, other)| **other == most);
        let stems: Vec<String> = same.map(|(stem, _)| stem.clone()).collect();
        groups
            .entry(stems)
            .or_default()
            .push((folder.clone(), most));
    }
    let runs = |folders: &Vec<(PathBuf, Vec<String>)>| -> usize {
        folders.iter().map(|(_, numbers)| numbers.len()).sum()
    };
    let (stems, folders) = groups
        .into_iter()
        .max_by_key(|(_, folders)| runs(folders))?;
    let (folders, numbers) = folders.into_iter().unzip();
    Some((folders, stems, numbers))
}

/// Runs as folders with the same files; a single folder or file is one run.
fn named(files: &BTreeMap<PathBuf, Vec<String>>) -> Option<Group> {
    let mut groups: BTreeMap<&Vec<String>, Vec<PathBuf>> = BTreeMap::new();
    for (folder, names) in files {
        groups.entry(names).or_default().push(folder.clone());
    }
    let (names, folders) = groups
        .into_iter()
        .max_by_key(|(_, folders)| folders.len())?;
    let numbers = folders.iter().map(|_| Vec::new()).collect();
    Some((folders, names.clone(), numbers))
}

fn group_places(path: &Path, (folders, stems, numbers): Group, all: usize) -> Places {
    let own_parent = parent(path);
    // A run that is the log's folder itself is named from above.
    let is_own = folders.iter().any(|folder| folder == path) && numbers.iter().any(Vec::is_empty);
    let base = if is_own && stems.len() > 1 {
        own_parent
    } else {
        path
    };
    let below = |folder: &Path| {
        let below = folder.strip_prefix(base).unwrap_or(folder);
        below.to_string_lossy().into_owned()
    };
    let join = |folder: String, name: &str| match folder.is_empty() {
        true => name.to_owned(),
        false => format!("{folder}/{name}"),
    };
    let is_file = stems.len() == 1 || numbers.iter().any(|numbers| !numbers.is_empty());
    let (mut runs, mut found) = (Vec::new(), Vec::new());
    for (folder, numbers) in folders.iter().zip(&numbers) {
        let first = stems.first().map_or("", String::as_str);
        runs.push(if is_file {
            join(below(folder), first)
        } else {
            below(folder)
        });
        let whole = [String::new()];
        let numbers = if numbers.is_empty() {
            &whole[..]
        } else {
            numbers
        };
        for number in numbers {
            let file = |stem: &String| folder.join(stem.replace('*', number));
            found.push(stems.iter().map(file).collect());
        }
    }
    let mut files: Vec<Option<String>> = stems.iter().cloned().map(Some).collect();
    if let (true, Some(first)) = (is_file, files.first_mut()) {
        *first = None;
    }
    let others = all - found.iter().map(Vec::len).sum::<usize>();
    Places {
        folder: base.to_owned(),
        runs,
        files,
        found,
        is_bag: false,
        others,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_belong_together_are_found() {
        let folder = tempfile::TempDir::new().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "t\n0\n").unwrap();
        };
        for ground in ["a", "b"] {
            for number in ["00", "01", "02"] {
                write(&format!("grounds/{ground}/pro_{number}.csv"));
                write(&format!("grounds/{ground}/imu_{number}.csv"));
            }
        }
        write("grounds/notes.csv");
        write("grounds/other/notes.csv");
        let found = places(&folder.path().join("grounds")).unwrap();
        assert_eq!(found.runs, ["a/imu_*.csv", "b/imu_*.csv"]);
        assert_eq!(found.files, [None, Some("pro_*.csv".into())]);
        assert_eq!((found.found.len(), found.others), (6, 2));
        assert!(found.found[4][1].ends_with("b/pro_01.csv"));

        for run in ["healthy", "faulty"] {
            write(&format!("topics/{run}/odom.csv"));
            write(&format!("topics/{run}/cmd.csv"));
        }
        let found = places(&folder.path().join("topics")).unwrap();
        assert_eq!(found.runs, ["faulty", "healthy"]);
        assert_eq!(
            found.files,
            [Some("cmd.csv".into()), Some("odom.csv".into())]
        );
        let found = places(&folder.path().join("topics/healthy")).unwrap();
        assert_eq!(found.runs, ["healthy"]);
        assert_eq!(found.folder, folder.path().join("topics"));
        let found = places(&folder.path().join("topics/healthy/odom.csv")).unwrap();
        assert_eq!(
            (&found.runs[..], &found.files[..]),
            (&["odom.csv".to_owned()][..], &[None][..])
        );
        assert!(places(&folder.path().join("nothing")).is_err());
    }
}
