//! The folder of a run: `run.jsonl`, `report.html`, and the files of the report.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::Context as _;
use serde::Serialize;

/// The folder of the workspace's `Cargo.toml`.
pub(crate) fn workspace_root() -> &'static Path {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own)
}

/// The day, as `2026-11-28`.
pub(crate) fn today() -> String {
    let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    now.chars().take_while(|c| *c != 'T').collect()
}

/// The folder of one run.
#[derive(Clone, Debug)]
pub(crate) struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Creates a folder named by time and commit, in `out` or in `target/bench`.
    pub(crate) fn create(out: Option<&Path>, rev: &str) -> anyhow::Result<Self> {
        let out = out.map_or_else(
            || workspace_root().join("target").join("bench"),
            Path::to_owned,
        );
        let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let path = out.join(format!("{}-{rev}", now.replace([':', '-'], "")));
        fs::create_dir_all(path.join("scenes"))
            .with_context(|| format!("cannot make {}", path.display()))?;
        Ok(Self { path })
    }

    /// An existing run.
    pub(crate) fn open(path: &Path) -> anyhow::Result<Self> {
        anyhow::ensure!(
            path.join("run.jsonl").exists(),
            "{} holds no run.jsonl",
            path.display()
        );
        Ok(Self {
            path: path.to_owned(),
        })
    }

    pub(crate) fn name(&self) -> String {
        let full = self
            .path
            .canonicalize()
            .unwrap_or_else(|_| self.path.clone());
        full.file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    pub(crate) fn records(&self) -> PathBuf {
        self.path.join("run.jsonl")
    }

    /// The records of Rust rivals in a build for this processor; the faster ones are also among the records of the run.
    pub(crate) fn native_records(&self) -> PathBuf {
        self.path.join("native.jsonl")
    }

    /// Another file of the run.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// A folder for temporary files.
    pub(crate) fn scratch(&self) -> PathBuf {
        self.path.join("scratch")
    }

    pub(crate) fn report(&self) -> PathBuf {
        self.path.join("report.html")
    }

    /// The picture of a scene, `shaded` or `heat`.
    pub(crate) fn picture(&self, scene: &str, kind: &str) -> PathBuf {
        self.path.join("scenes").join(format!("{scene}.{kind}.png"))
    }

    /// The scale of the heat picture's colors.
    pub(crate) fn heat_scale(&self, scene: &str) -> PathBuf {
        self.path.join("scenes").join(format!("{scene}.heat.json"))
    }

    /// The statistics of the baseline's tree, as text.
    pub(crate) fn statistics(&self, scene: &str) -> PathBuf {
        self.path.join("scenes").join(format!("{scene}.txt"))
    }

    /// Copies the run to `latest` beside it and replaces the one there.
    pub(crate) fn publish_as_latest(&self) -> anyhow::Result<PathBuf> {
        let out = self.path.parent().context("a run has a parent folder")?;
        let (latest, fresh) = (out.join("latest"), out.join(".latest.new"));
        if fresh.exists() {
            fs::remove_dir_all(&fresh)?;
        }
        copy_folder(&self.path, &fresh)?;
        if latest.exists() {
            fs::remove_dir_all(&latest)?;
        }
        fs::rename(&fresh, &latest)?;
        Ok(latest)
    }
}

fn copy_folder(from: &Path, to: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_folder(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

/// Writes a file under another name and then renames it, so that a reader never sees half of it.
pub(crate) fn write(path: &Path, contents: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".new");
    fs::write(&unfinished, contents)
        .and_then(|()| fs::rename(&unfinished, path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// One JSON object a line.
pub(crate) fn json_lines<T: Serialize>(
    values: impl IntoIterator<Item = T>,
) -> anyhow::Result<String> {
    let mut lines = String::new();
    for value in values {
        lines += &serde_json::to_string(&value)?;
        lines.push('\n');
    }
    Ok(lines)
}

/// Writes the same contents to several files and prints their names.
pub(crate) fn write_all(
    paths: impl IntoIterator<Item = Option<PathBuf>>,
    contents: impl AsRef<[u8]>,
) -> anyhow::Result<()> {
    for path in paths.into_iter().flatten() {
        write(&path, &contents)?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_run_replaces_the_one_before() {
        let out = tempfile::tempdir().expect("a folder");
        for rev in ["first", "second"] {
            let run = RunFolder::create(Some(out.path()), rev).expect("made");
            write(&run.records(), rev).expect("written");
            write(&run.statistics("hall"), rev).expect("written");
            let latest = run.publish_as_latest().expect("copied");
            let read = |path: PathBuf| fs::read_to_string(path).expect("there");
            let latest = RunFolder::open(&latest).expect("a run");
            assert_eq!(
                (read(latest.records()), read(latest.statistics("hall"))),
                (rev.into(), rev.into()),
                "all of it"
            );
            assert!(run.name().ends_with(rev), "{}", run.name());
        }
        let left_over = fs::read_dir(out.path()).expect("there").count();
        assert_eq!(left_over, 3, "two runs and the latest");
        assert!(RunFolder::open(out.path()).is_err(), "this is not a run");
    }
}
