//! The command `kd convert`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use kd::Mesh;

use crate::print::print_line;
use crate::scene::{Builder, SceneArgs};
use crate::tree;

/// Arguments of `kd convert`.
#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Output file: .ply or .obj for the triangles, .kd for the triangles and their tree
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Builder of the tree, for .kd
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
            let tree = tree::build(mesh, arguments.builder)?;
            tree.save(path)?;
            return report(path, tree.mesh());
        }
        _ => bail!(
            "{}: unknown output format; use .ply or .obj for a mesh, .kd for a tree",
            path.display()
        ),
    };
    let mesh = mesh(&arguments.scene)?;
    let file = File::create(path).with_context(|| format!("{}", path.display()))?;
    let mut out = BufWriter::new(file);
    let written = write(&mesh, &mut out).and_then(|()| out.flush());
    written.with_context(|| format!("{}", path.display()))?;
    report(path, &mesh)
}

fn mesh(arguments: &SceneArgs) -> anyhow::Result<Mesh> {
    if let Some(tree) = tree::open(arguments)? {
        return Ok(tree.mesh().clone());
    }
    let scene = arguments.load_with_warnings()?;
    Ok(scene.mesh_at(arguments.time(&scene)?)?)
}

fn report(path: &Path, mesh: &Mesh) -> anyhow::Result<()> {
    print_line(format_args!("{}: {} triangles", path.display(), mesh.len()))?;
    Ok(())
}

/// Writes a binary little-endian PLY file.
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

/// Writes an OBJ file. Numbers have the fewest digits that read back to the same `f32`.
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
    fn written_meshes_read_back_unchanged() {
        let mesh = Spd::Tetra.generate(2).expect("within the limits").mesh;
        let corners =
            |mesh: &Mesh| -> Vec<_> { (0..).take(mesh.len()).map(|i| mesh.corners(i)).collect() };
        let mut bytes = Vec::new();
        write_ply(&mesh, &mut bytes).expect("a written file");
        let ply = read_ply(bytes.as_slice(), "ply").expect("valid");
        assert_eq!(corners(&ply), corners(&mesh));
        bytes.clear();
        write_obj(&mesh, &mut bytes).expect("a written file");
        let obj = read_obj(bytes.as_slice(), "obj").expect("valid");
        assert_eq!(corners(&obj), corners(&mesh));
    }
}
