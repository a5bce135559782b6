//! Commands that measure scene by scene and print one view of all cells.

use std::path::PathBuf;

use clap::{Args, ValueEnum as _};

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::names::REFERENCE;
use crate::rays::RayKind;
use crate::record::Record;
use crate::run_folder::{self, RunFolder};
use crate::scenes::{self, Scene, SceneSource};
use crate::session::Session;
use crate::text;
use crate::view::{Comparison, View};
use crate::workload::{self, Amount, Traced, Workload};

/// What to measure, how often, and where the results go. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct SceneTableArgs {
    /// Measures the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: those of the command's goals]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    pub(crate) samples: usize,

    /// Tiny scenes and few rays: a check that the command works
    #[arg(long)]
    pub(crate) smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Where the folder of the run goes [default: target/bench of the workspace]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// What a command measures on each scene, and the view that it prints.
pub(crate) struct SceneTable<'a> {
    /// The scenes in a folder if none is named; `None` for all of them.
    pub(crate) usual: Option<&'a [&'a str]>,
    /// Whether the generated rooms are measured beside those of a folder if none is named.
    pub(crate) with_rooms: bool,
    pub(crate) view: View,
    /// The file of rows in the folder of the run.
    pub(crate) file: &'a str,
    /// Printed below the table.
    pub(crate) note: &'a str,
    /// Pixels along the side of the primary image, and the limit of the other rays.
    pub(crate) rays: (u32, usize),
    /// Comparisons that are left out on a scene.
    pub(crate) leaves_out: fn(&Scene, &Comparison) -> bool,
}

impl SceneTableArgs {
    /// The chosen scenes.
    fn sources(
        &self,
        usual: Option<&[&str]>,
        with_rooms: bool,
    ) -> anyhow::Result<Vec<SceneSource>> {
        let named = match (&self.scenes, usual) {
            (Some(folder), None) if self.scene.is_empty() => {
                let mut sources = scenes::in_folder(folder)?;
                if with_rooms {
                    sources.extend(scenes::rooms(self.smoke));
                }
                return Ok(sources);
            }
            (Some(_), Some(usual)) if self.scene.is_empty() => {
                &usual.iter().map(|name| (*name).to_owned()).collect()
            }
            _ => &self.scene,
        };
        scenes::choose_from(self.scenes.as_deref(), named, self.smoke)
    }

    /// Measures, prints and writes; false if an answer is wrong. A missed goal is printed and is no failure.
    ///
    /// The comparisons of the view are measured; `measure` adds its other cells, and `more` what the table does not have: it
    /// prints, and returns further JSON lines.
    pub(crate) fn run(
        &self,
        command: &SceneTable<'_>,
        measure: impl Fn(&mut Session<'_>, &Scene) -> anyhow::Result<()>,
        more: impl FnOnce(&RunFolder, &[Record]) -> anyhow::Result<String>,
    ) -> anyhow::Result<bool> {
        self.run_with(command, measure, |_| Ok(Vec::new()), more)
    }

    /// [`run`](Self::run) with further cells, which belong to no scene of the command.
    pub(crate) fn run_with(
        &self,
        command: &SceneTable<'_>,
        measure: impl Fn(&mut Session<'_>, &Scene) -> anyhow::Result<()>,
        others: impl FnOnce(&Environment) -> anyhow::Result<Vec<Record>>,
        more: impl FnOnce(&RunFolder, &[Record]) -> anyhow::Result<String>,
    ) -> anyhow::Result<bool> {
        let sources = self.sources(command.usual, command.with_rooms)?;
        let environment = Environment::detect();
        let folder = RunFolder::create(self.out.as_deref(), &environment.rev)?;
        let (mut cells, mut problems) = (Vec::new(), Vec::new());
        for source in &sources {
            eprintln!("{}", source.name);
            let scene = source.load()?;
            let triangles = scene.mesh.len();
            let mut session = Session::new(&environment, &source.name, triangles, self.samples);
            session.workloads = command.workloads(&scene)?;
            command.compare(&mut session, &scene)?;
            measure(&mut session, &scene)?;
            cells.extend(session.cells);
            problems.extend(session.problems);
            // After each scene, so that an interrupted run keeps its cells.
            run_folder::write(&folder.records(), run_folder::json_lines(&cells)?)?;
        }
        cells.extend(others(&environment)?);
        run_folder::write(&folder.records(), run_folder::json_lines(&cells)?)?;
        let table = command.view.of(&cells);
        println!("{table}");
        let (samples, note) = (self.samples, command.note);
        println!("medians of {samples} pairs for each scene, {note}");
        let lines = table.to_lines()? + &more(&folder, &cells)?;
        run_folder::write_all([Some(folder.file(command.file)), self.json.clone()], &lines)?;
        Ok(text::report_problems(&problems))
    }
}

impl SceneTable<'_> {
    /// Rays of all kinds, without a test of every triangle.
    fn workloads(&self, scene: &Scene) -> anyhow::Result<Vec<Workload>> {
        let reference = REFERENCE.build(&scene.mesh, 1)?.structure;
        let (side, ray_limit) = self.rays;
        let amount = Amount {
            side,
            ray_limit,
            brute_force_tests: 0,
            least_checked: 0,
        };
        let kinds = RayKind::value_variants();
        Ok(workload::all(scene, kinds, amount, &*reference))
    }

    /// Measures the comparisons of the view. Kinds without rays are left out.
    fn compare(&self, session: &mut Session<'_>, scene: &Scene) -> anyhow::Result<()> {
        let mesh = &scene.mesh;
        let mut comparisons = self.view.comparisons();
        comparisons.retain(|comparison| !(self.leaves_out)(scene, comparison));
        for Comparison { own, over, rays } in comparisons {
            let Some((kinds, by)) = rays else {
                session.build(mesh, own, over)?;
                continue;
            };
            let (structure, baseline) = (own.0.build(mesh, 1)?, over.0.build(mesh, 1)?);
            let traced = Traced::single(&*structure.structure).by(by).on(own.1);
            let baseline = Traced::single(&*baseline.structure).on(over.1);
            for kind in kinds {
                if !session.workload(kind).rays.is_empty() {
                    session.trace(kind, (own.0, traced), (over.0, baseline));
                }
            }
        }
        Ok(())
    }
}
