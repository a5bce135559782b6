//! Builds of hostile meshes over those of a sphere, and rays through them over rays through objects alone.

use std::hint::black_box;
use std::sync::Arc;

use kd::{BuildOptions, KdTree, Mesh};
use kd_scene::Hostile;

use super::rays_through;
use crate::arguments::name_of;
use crate::builds::PRESETS;
use crate::environment::Environment;
use crate::measure::{in_pairs, in_sure_pairs};
use crate::names::BuilderName;
use crate::record::Record;
use crate::session::Session;

/// Triangles of each mesh, and rays: few, since a ray through overlapping triangles tests most of them.
const SIZE: (usize, usize) = (200_000, 1000);
const SMOKE: (usize, usize) = (2000, 20);

/// Cells of the variants `kd/PRESET/hostile`, over `kd/PRESET/sphere` for builds and over `kd/fast/hostile` for rays.
pub(super) fn measure(
    environment: &Environment,
    samples: usize,
    is_smoke: bool,
) -> anyhow::Result<Vec<Record>> {
    let (triangles, rays) = if is_smoke { SMOKE } else { SIZE };
    let sphere = Arc::new(Hostile::sphere(triangles)?);
    let mut cells = Vec::new();
    for hostile in Hostile::ALL {
        eprintln!("{hostile}");
        let mesh = Arc::new(hostile.generate(triangles)?);
        let mut session = Session::new(environment, hostile.name(), mesh.len(), samples);
        let rays = rays_through(&mesh.bounds(), rays);
        let fast = KdTree::build(Arc::clone(&mesh), &options(BuilderName::Fast))?;
        for preset in PRESETS {
            let [own, over] =
                ["hostile", "sphere"].map(|mesh| format!("kd/{}/{mesh}", name_of(&preset)));
            let build = |mesh: &Arc<Mesh>| KdTree::build(Arc::clone(mesh), &options(preset));
            let pairs = in_pairs(session.repeats, || build(&sphere), || build(&mesh))?;
            session.add_build(&own, &over, &pairs);
            if preset == BuilderName::Fast {
                continue;
            }
            let tree = KdTree::build(Arc::clone(&mesh), &options(preset))?;
            let trace = |tree: &KdTree| {
                for ray in &rays {
                    black_box(tree.intersect(ray));
                }
            };
            let pairs = in_sure_pairs(session.repeats, || trace(&fast), || trace(&tree));
            session.add_rays(&own, "random", "kd/fast/hostile", &pairs, rays.len());
        }
        cells.extend(session.cells);
    }
    Ok(cells)
}

fn options(preset: BuilderName) -> BuildOptions {
    preset.options().expect("a preset").with_threads(1)
}
