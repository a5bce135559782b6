//! Moving scenes: folders of baked frames, and generated ones.
//!
//! ```text
//! manifest.json    frames, groups of triangles that matrices move, light, view; or triangles between key positions
//! static.ply       the static triangles; optional
//! group_*.ply      triangles of each group, before its matrix
//! matrices.f32     [frame][group][3][4], rows, to the world
//! camera.f32       [frame][position 3, direction 3, up 3]; optional
//! tpa_keys.f32     [key][triangle][vertex 3][3]; or
//! positions.f32    [frame][vertex][3], over the triangles of frame0.ply
//! ```

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use kd::glam::{Affine3A, Mat3A, Vec3, Vec3A};
use kd::{BuildOptions, Mesh, PartId, Strategy};
use kd_scene::{Camera, Spd};
use serde::Deserialize;

/// Static and moving meshes.
#[derive(Debug)]
pub(crate) struct Animation {
    pub(crate) name: String,
    pub(crate) fixed: Arc<Mesh>,
    /// Each in the position where its motion starts.
    pub(crate) groups: Vec<Arc<Mesh>>,
    motion: Motion,
    cameras: Vec<Camera>,
    pub(crate) light: Vec3,
    /// The frames to measure, with their labels.
    pub(crate) rows: Vec<(String, usize)>,
}

#[derive(Debug)]
enum Motion {
    /// Of every group, by frame.
    Matrices(Vec<Affine3A>),
    /// Of the one group.
    Positions(Vec<Vec<[f32; 3]>>),
}

#[derive(Debug, Deserialize)]
struct Manifest {
    frames: Option<usize>,
    anim: Option<Times>,
    #[serde(default)]
    lights: Vec<(Option<String>, [f32; 3], [f32; 3])>,
    #[serde(default)]
    groups: Vec<Group>,
    tpa: Option<Keys>,
    view: Option<View>,
}

#[derive(Debug, Deserialize)]
struct Times {
    start: f32,
    end: f32,
    frames: usize,
}

#[derive(Debug, Deserialize)]
struct Group {
    file: String,
}

#[derive(Debug, Deserialize)]
struct Keys {
    triangles: usize,
    key_times: Vec<f32>,
}

#[derive(Debug, Deserialize)]
struct View {
    angle: [f32; 1],
}

/// The number of frames to measure.
const ROWS: usize = 10;

impl Animation {
    /// Reads a folder.
    pub(crate) fn load(folder: &Path) -> anyhow::Result<Self> {
        let read = || -> anyhow::Result<Self> {
            let manifest = std::fs::read(folder.join("manifest.json"))?;
            let manifest: Manifest = serde_json::from_slice(&manifest).context("manifest.json")?;
            Self::of_manifest(folder, &manifest)
        };
        read().with_context(|| folder.display().to_string())
    }

    fn of_manifest(folder: &Path, manifest: &Manifest) -> anyhow::Result<Self> {
        let path = folder.join("static.ply");
        let fixed = if path.exists() {
            kd::load_mesh(path)?
        } else {
            Mesh::new(vec![], vec![])?
        };
        let times = manifest.anim.as_ref();
        let frames = times.map(|times| times.frames).or(manifest.frames);
        let frames = frames.context("the number of frames is missing")?;
        ensure!(frames > 0, "the number of frames is 0");
        let (groups, motion) = if let (Some(keys), Some(times)) = (&manifest.tpa, times) {
            free_triangles(folder, keys, times)?
        } else if manifest.groups.is_empty() {
            deforming(folder, frames)?
        } else {
            let load = |group: &Group| kd::load_mesh(folder.join(&group.file));
            let groups: Vec<Mesh> = manifest.groups.iter().map(load).collect::<Result<_, _>>()?;
            let matrices = floats(&folder.join("matrices.f32"))?;
            let matrices: Vec<Affine3A> = matrices.as_chunks().0.iter().map(matrix).collect();
            ensure!(
                matrices.len() == frames * groups.len(),
                "matrices.f32: {} matrices for {frames} frames of {} groups",
                matrices.len(),
                groups.len()
            );
            (groups, Motion::Matrices(matrices))
        };
        let name = folder.file_name().unwrap_or_default();
        let mut animation = Self {
            name: name.to_string_lossy().into_owned(),
            fixed: Arc::new(fixed),
            groups: groups.into_iter().map(Arc::new).collect(),
            motion,
            cameras: Vec::new(),
            light: Vec3::ZERO,
            rows: (1..=ROWS)
                .map(|row| {
                    (
                        format!("{}", 2 * row),
                        (2 * row * (frames - 1) + ROWS) / (2 * ROWS),
                    )
                })
                .collect(),
        };
        let fov = manifest.view.as_ref().map_or(45.0, |view| view.angle[0]);
        let cameras = folder.join("camera.f32");
        animation.cameras = if cameras.exists() {
            let camera = |c: &[f32; 9]| {
                let [eye, direction, up] = [0, 3, 6].map(|at| Vec3::from_slice(&c[at..at + 3]));
                Camera {
                    eye,
                    target: eye + direction,
                    up,
                    fov_degrees: fov,
                }
            };
            floats(&cameras)?.as_chunks().0.iter().map(camera).collect()
        } else {
            let bounds = animation.whole(0)?.bounds();
            vec![Camera::looking_at_whole(bounds, Vec3::Y); frames]
        };
        ensure!(
            animation.cameras.len() == frames,
            "one camera for each frame"
        );
        let light = manifest.lights.first().map(|light| Vec3::from(light.1));
        animation.light = light.unwrap_or(animation.cameras[0].eye + Vec3::Y);
        Ok(animation)
    }

    /// A room with clutter of about 570 · `size`³ triangles in its middle, and an object of about `share` of that number, which
    /// moves from outside the clutter inwards and finally covers it.
    pub(crate) fn generated(size: u32, share: f64) -> anyhow::Result<Self> {
        Self::with_object(size, |fixed| share * fixed as f64)
    }

    /// [`generated`](Self::generated) with an object of about `moving` triangles, a function of the number of static ones.
    pub(crate) fn with_object(size: u32, moving: impl Fn(usize) -> f64) -> anyhow::Result<Self> {
        let clutter = Spd::Gears.generate(size)?.mesh;
        let bounds = clutter.bounds();
        let room = room_around(&clutter)?;
        let wanted = moving(room.len());
        let sizes = 1..200;
        let objects = sizes.map(|size| Spd::Teapot.generate(size).map(|setup| setup.mesh));
        let mut object = None;
        for mesh in objects {
            let mesh = mesh?;
            let is_enough = mesh.len() as f64 >= wanted;
            object = Some(mesh);
            if is_enough {
                break;
            }
        }
        let object = object.context("teapots of all sizes")?;
        let extent = bounds.extent();
        let scale =
            |size: f32| size * extent.max_element() / object.bounds().extent().max_element();
        let place = |(_, place, size): &(&str, Vec3, f32)| {
            let scale = Vec3::splat(scale(*size));
            let center = bounds.center() + *place * extent;
            Affine3A::from_translation(center)
                * Affine3A::from_scale(scale)
                * Affine3A::from_translation(-object.bounds().center())
        };
        let rows = (0..)
            .zip(&POSES)
            .map(|(frame, pose)| (pose.0.into(), frame));
        let camera = Camera {
            eye: bounds.center() + extent * Vec3::new(0.9, 0.3, 0.85),
            target: bounds.center(),
            up: Vec3::Y,
            fov_degrees: 60.0,
        };
        Ok(Self {
            name: format!(
                "room, {:.1} % move",
                100.0 * object.len() as f64 / room.len() as f64
            ),
            fixed: Arc::new(room),
            rows: rows.collect(),
            motion: Motion::Matrices(POSES.iter().map(place).collect()),
            groups: vec![Arc::new(object)],
            cameras: vec![camera; POSES.len()],
            light: bounds.center() + extent * Vec3::new(0.3, 0.95, 0.2),
        })
    }

    pub(crate) fn camera(&self, frame: usize) -> &Camera {
        &self.cameras[frame]
    }

    /// The frame before, or for the first the one after.
    pub(crate) fn before(&self, frame: usize) -> usize {
        frame
            .checked_sub(1)
            .unwrap_or(1.min(self.cameras.len() - 1))
    }

    /// A scene of the static mesh and of a part for each group, not committed.
    pub(crate) fn scene(
        &self,
        options: BuildOptions,
        strategy: Strategy,
    ) -> anyhow::Result<(kd::Scene, Vec<PartId>)> {
        let mut scene = kd::Scene::new(options);
        scene.set_strategy(strategy);
        scene.add_static(Arc::clone(&self.fixed))?;
        let groups = self.groups.iter();
        let parts = groups.map(|mesh| scene.add_dynamic(Arc::clone(mesh)));
        let parts = parts.collect::<Result<_, _>>()?;
        Ok((scene, parts))
    }

    /// Moves the parts of a scene, one for each group, to a frame.
    pub(crate) fn set(
        &self,
        scene: &mut kd::Scene,
        parts: &[PartId],
        frame: usize,
    ) -> anyhow::Result<()> {
        match &self.motion {
            Motion::Matrices(matrices) => {
                let of_frame = &matrices[frame * parts.len()..];
                for (part, matrix) in parts.iter().zip(of_frame) {
                    scene.set_transform(*part, *matrix)?;
                }
            }
            Motion::Positions(positions) => scene.set_positions(parts[0], &positions[frame])?,
        }
        Ok(())
    }

    /// The groups in their positions of a frame.
    pub(crate) fn moved(&self, frame: usize) -> anyhow::Result<Vec<Mesh>> {
        Ok(match &self.motion {
            Motion::Matrices(matrices) => {
                let pairs = self
                    .groups
                    .iter()
                    .zip(&matrices[frame * self.groups.len()..]);
                let moved = pairs.map(|(mesh, matrix)| mesh.transformed(matrix));
                moved.collect::<Result<_, _>>()?
            }
            Motion::Positions(positions) => {
                vec![self.groups[0].with_positions(positions[frame].clone())?]
            }
        })
    }

    /// All triangles of a frame as one mesh, the static ones first.
    pub(crate) fn whole(&self, frame: usize) -> anyhow::Result<Mesh> {
        let moved = self.moved(frame)?;
        let all = std::iter::once(&*self.fixed).chain(&moved);
        Ok(Mesh::concatenated(all)?)
    }
}

/// Poses of the generated object: label, position in extents of the clutter, size.
const POSES: [(&str, Vec3, f32); 6] = [
    ("outside", Vec3::new(0.8, 0.05, 0.1), 0.2),
    ("at the edge", Vec3::new(0.6, 0.05, 0.1), 0.2),
    ("half inside", Vec3::new(0.5, 0.05, 0.1), 0.2),
    ("mostly inside", Vec3::new(0.4, 0.05, 0.1), 0.2),
    ("inside", Vec3::new(0.2, 0.05, 0.1), 0.2),
    ("all over it", Vec3::ZERO, 1.0),
];

/// Floor, ceiling and walls around clutter.
fn room_around(clutter: &Mesh) -> anyhow::Result<Mesh> {
    let bounds = clutter.bounds();
    let half = bounds.extent();
    let walls = cuboid(bounds.center() - half, bounds.center() + half)?;
    Ok(Mesh::concatenated([&walls, clutter])?)
}

/// The six sides of a box, as twelve triangles.
pub(crate) fn cuboid(low: Vec3, high: Vec3) -> anyhow::Result<Mesh> {
    let corner = |corner: usize| [0, 1, 2].map(|axis| [low, high][corner >> axis & 1][axis]);
    let positions = [0, 1, 2, 3, 4, 5, 6, 7].map(corner).to_vec();
    let sides = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let triangles = sides
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    Ok(Mesh::new(positions, triangles.collect())?)
}

fn floats(path: &Path) -> anyhow::Result<Vec<f32>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let (numbers, rest) = bytes.as_chunks();
    ensure!(rest.is_empty(), "{} ends within a number", path.display());
    Ok(numbers
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect())
}

fn matrix(rows: &[f32; 12]) -> Affine3A {
    let column = |at: usize| Vec3A::new(rows[at], rows[4 + at], rows[8 + at]);
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

/// Triangles without common vertices that move from key to key.
fn free_triangles(
    folder: &Path,
    keys: &Keys,
    times: &Times,
) -> anyhow::Result<(Vec<Mesh>, Motion)> {
    let all = floats(&folder.join("tpa_keys.f32"))?;
    let corners: &[[f32; 3]] = all.as_chunks().0;
    let of_key = 3 * keys.triangles;
    ensure!(
        corners.len() == of_key * keys.key_times.len() && !keys.key_times.is_empty(),
        "tpa_keys.f32: {} corners for {} keys of {} triangles",
        corners.len(),
        keys.key_times.len(),
        keys.triangles
    );
    let at = |time: f32| -> Vec<[f32; 3]> {
        let after = keys.key_times.partition_point(|key| *key <= time);
        let before = after.saturating_sub(1);
        let after = after.min(keys.key_times.len() - 1);
        let span = keys.key_times[after] - keys.key_times[before];
        let part = if span > 0.0 {
            ((time - keys.key_times[before]) / span).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let (from, to) = (&corners[before * of_key..], &corners[after * of_key..]);
        let pairs = from.iter().zip(to).take(of_key);
        pairs
            .map(|(a, b)| Vec3::from(*a).lerp(Vec3::from(*b), part).to_array())
            .collect()
    };
    let last = (times.frames.max(2) - 1) as f32;
    let time = |frame: usize| times.start + (times.end - times.start) * frame as f32 / last;
    let positions: Vec<_> = (0..times.frames).map(|frame| at(time(frame))).collect();
    let triangles = (0..u32::try_from(keys.triangles)?).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    let mesh = Mesh::new(positions[0].clone(), triangles.collect())?;
    Ok((vec![mesh], Motion::Positions(positions)))
}

/// One mesh with new positions in every frame.
fn deforming(folder: &Path, frames: usize) -> anyhow::Result<(Vec<Mesh>, Motion)> {
    let mesh = kd::load_mesh(folder.join("frame0.ply"))?;
    let all = floats(&folder.join("positions.f32"))?;
    let (positions, rest) = all.as_chunks();
    let vertices = positions.len() / frames;
    ensure!(
        rest.is_empty() && vertices * frames == positions.len() && vertices > 0,
        "positions.f32: {} numbers for {frames} frames",
        all.len()
    );
    let largest = mesh.triangles().iter().flatten().max();
    ensure!(
        largest.is_none_or(|corner| (*corner as usize) < vertices),
        "frame0.ply has more vertices than positions.f32"
    );
    let frames: Vec<Vec<[f32; 3]>> = positions.chunks(vertices).map(<[_]>::to_vec).collect();
    let mesh = Mesh::new(frames[0].clone(), mesh.triangles().to_vec())?;
    Ok((vec![mesh], Motion::Positions(frames)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generated_object_comes_in() {
        let room = Animation::generated(1, 0.2).expect("generated");
        let clutter = Spd::Gears.generate(1).expect("small").mesh.bounds();
        let share = room.groups[0].len() as f64 / room.fixed.len() as f64;
        assert!((0.2..0.5).contains(&share), "{share}");
        let common = |frame: usize| {
            let object = room.moved(frame).expect("finite")[0].bounds();
            let common = object.intersection(&clutter);
            if common.is_empty() {
                0.0
            } else {
                common.extent().element_product()
            }
        };
        let overlaps: Vec<f32> = room.rows.iter().map(|(_, frame)| common(*frame)).collect();
        assert_eq!(overlaps[0], 0.0, "outside");
        assert!(
            overlaps.is_sorted(),
            "further in with every pose: {overlaps:?}"
        );
    }

    #[test]
    fn folders_that_are_not_animations_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |text: &str| {
            std::fs::write(folder.path().join("manifest.json"), text).expect("written");
            format!("{:#}", Animation::load(folder.path()).expect_err("refused"))
        };
        assert!(refused("{").contains("manifest.json"), "no JSON");
        assert!(refused("{}").contains("number of frames"), "no frames");
        let lacking = refused(r#"{"frames": 2}"#);
        assert!(lacking.contains("frame0.ply"), "no mesh: {lacking}");
    }
}
