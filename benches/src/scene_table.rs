//! What commands have in common that measure scene by scene and print one table.

use std::path::PathBuf;

use clap::Args;

use crate::cli::at_least_one;
use crate::environment::Environment;
use crate::run_folder::{self, RunFolder};
use crate::scenes::{self, SceneSource};

/// What to measure, how often, and where it goes. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct SceneTableArgs {
    /// Takes the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    pub(crate) scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: those that the command is about]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) scene: Vec<String>,

    /// Timed repeats of everything, each after one of what it is compared with
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    pub(crate) samples: usize,

    /// Tiny scenes and few rays: a check that everything works
    #[arg(long)]
    pub(crate) smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Where the folder of the run goes [default: target/bench of the workspace]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl SceneTableArgs {
    /// The scenes that are asked for. If none is named, those of a folder that the command is about; or all of it, if that is
    /// any.
    pub(crate) fn sources(&self, usual: Option<&[&str]>) -> anyhow::Result<Vec<SceneSource>> {
        let named = match (&self.scenes, usual) {
            (Some(folder), None) if self.scene.is_empty() => return scenes::in_folder(folder),
            (Some(_), Some(usual)) if self.scene.is_empty() => {
                &usual.iter().map(|name| (*name).to_owned()).collect()
            }
            _ => &self.scene,
        };
        scenes::choose_from(self.scenes.as_deref(), named, self.smoke)
    }

    /// Figures of each scene, and the folder of the run, which is made before anything is measured.
    pub(crate) fn measure<F>(
        &self,
        sources: &[SceneSource],
        measure: impl Fn(&SceneSource) -> anyhow::Result<F>,
    ) -> anyhow::Result<(RunFolder, Vec<F>)> {
        let folder = RunFolder::create(self.out.as_deref(), &Environment::detect().rev)?;
        let measured = sources.iter().map(|source| {
            eprintln!("{}", source.name);
            measure(source)
        });
        Ok((folder, measured.collect::<anyhow::Result<_>>()?))
    }

    /// Writes the rows to a file of the run's folder, and to the one that was asked for.
    pub(crate) fn keep(&self, own: PathBuf, lines: &str) -> anyhow::Result<()> {
        for path in [Some(own), self.json.clone()].into_iter().flatten() {
            run_folder::write(&path, lines)?;
            println!("wrote {}", path.display());
        }
        Ok(())
    }
}
