//! `kd convert`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use kd::{KdTree, Mesh};

use crate::say::say;
use crate::scene::{Builder, SceneArgs};

/// What to write, and where.
#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// .ply or .obj for the triangles, .kd for them and their tree
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Which builder, for .kd
    #[arg(long, value_enum, default_value_t = Builder::Best)]
    builder: Builder,
}

pub(crate) fn run(arguments: &ConvertArgs) -> anyhow::Result<()> {
    let path = &arguments.output;
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let write: fn(&Mesh, &mut dyn Write) -> std::io::Result<()> = match extension.as_ref() {
        "ply" => write_ply,
        "obj" => write_obj,
        "kd" => {
            let mesh = mesh(&arguments.scene)?;
            let tree = KdTree::build(mesh, &arguments.builder.options())?;
            tree.save(path)?;
            return told(path, tree.mesh());
        }
        _ => bail!(
            "{}: meshes are written as .ply or .obj, trees as .kd",
            path.display()
        ),
    };
    let mesh = mesh(&arguments.scene)?;
    let file = File::create(path).with_context(|| format!("{}", path.display()))?;
    let mut out = BufWriter::new(file);
    let written = write(&mesh, &mut out).and_then(|()| out.flush());
    written.with_context(|| format!("{}", path.display()))?;
    told(path, &mesh)
}

fn mesh(arguments: &SceneArgs) -> anyhow::Result<Mesh> {
    let scene = arguments.load()?;
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(scene.mesh_at(arguments.time(&scene)?)?)
}

fn told(path: &Path, mesh: &Mesh) -> anyhow::Result<()> {
    say(format_args!("{}: {} triangles", path.display(), mesh.len()))?;
    Ok(())
}

/// Binary, least byte first.
fn write_ply(mesh: &Mesh, out: &mut dyn Write) -> std::io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.positions().len(),
        mesh.len()
    )?;
    for coordinate in mesh.positions().iter().flatten() {
        out.write_all(&coordinate.to_le_bytes())?;
    }
    for corners in mesh.triangles() {
        out.write_all(&[3])?;
        for corner in corners {
            out.write_all(&corner.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Numbers as short as they can be without becoming others.
fn write_obj(mesh: &Mesh, out: &mut dyn Write) -> std::io::Result<()> {
    for [x, y, z] in mesh.positions() {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for [a, b, c] in mesh.triangles() {
        writeln!(
            out,
            "f {} {} {}",
            u64::from(*a) + 1,
            u64::from(*b) + 1,
            u64::from(*c) + 1
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use kd_scene::{Spd, read_obj, read_ply};

    use super::*;

    #[test]
    fn meshes_are_read_back_as_they_were() {
        let mesh = Spd::Tetra.generate(2).expect("small").mesh;
        let corners =
            |mesh: &Mesh| -> Vec<_> { (0..).take(mesh.len()).map(|i| mesh.corners(i)).collect() };
        let mut bytes = Vec::new();
        write_ply(&mesh, &mut bytes).expect("written");
        let ply = read_ply(&bytes, "ply").expect("valid");
        assert_eq!(corners(&ply), corners(&mesh));
        bytes.clear();
        write_obj(&mesh, &mut bytes).expect("written");
        let obj = read_obj(bytes.as_slice(), "obj").expect("valid");
        assert_eq!(corners(&obj), corners(&mesh));
    }
}
