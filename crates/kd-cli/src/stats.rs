//! The command `kd stats`.

use clap::Args;
use kd_scene::{Part, SceneDescription, TextureSource};

use crate::print::print_line;
use crate::scene::{Builder, SceneArgs};
use crate::tree;

/// Arguments of `kd stats`.
#[derive(Args, Debug)]
pub(crate) struct StatsArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Builder of the tree
    #[arg(long, value_enum, default_value_t = Builder::Best)]
    builder: Builder,
}

pub(crate) fn run(arguments: &StatsArgs) -> anyhow::Result<()> {
    if let Some(tree) = tree::open(&arguments.scene)? {
        let file = &arguments.scene.scene;
        print_line(format_args!("tree in {file}:\n{}", tree.stats()))?;
        return Ok(());
    }
    let scene = arguments.scene.load_with_warnings()?;
    let time = arguments.scene.time(&scene)?;
    print_line(format_args!("{}", description(&scene, time).trim_end()))?;
    let tree = tree::build(scene.mesh_at(time)?, arguments.builder)?;
    print_line(format_args!(
        "tree of all parts at {time} s, builder `{}`:\n{}",
        arguments.builder.name(),
        tree.stats()
    ))?;
    Ok(())
}

/// The contents of a scene, one line each.
fn description(scene: &SceneDescription, time: f64) -> String {
    use std::fmt::Write;

    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "{label:<12} {value}");
    };
    let of_part = |part: &Part| part.mesh.len() * part.copies();
    let triangles: usize = scene.parts.iter().map(of_part).sum();
    let moving = scene.parts.iter().filter(|part| part.may_move());
    let moving: usize = moving.map(of_part).sum();
    line(
        "triangles",
        format!("{triangles}, of which {moving} can move"),
    );
    line("parts", scene.parts.len().to_string());
    for part in &scene.parts {
        let name = if part.name.is_empty() {
            "(static)"
        } else {
            &part.name
        };
        let visibility = if scene.is_visible(part, time) {
            ""
        } else {
            ", invisible"
        };
        let instances = match part.instances.len() {
            0 => String::new(),
            instances => format!(" in each of {instances} instances"),
        };
        let triangles = part.mesh.len();
        line("", format!("{name}: {triangles}{instances}{visibility}"));
    }
    line("lights", scene.lights.len().to_string());
    line("materials", scene.materials.len().to_string());
    let missing = scene
        .textures
        .iter()
        .filter(|texture| matches!(&texture.source, TextureSource::File(path) if !path.exists()));
    line(
        "textures",
        format!(
            "{}, of which {} are missing",
            scene.textures.len(),
            missing.count()
        ),
    );
    if let Some(span) = scene.span {
        line(
            "animation",
            format!(
                "{} frames from {} to {} s",
                span.frames, span.start, span.end
            ),
        );
    }
    text
}
