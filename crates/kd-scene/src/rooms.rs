//! Two generated rooms: walls of few large triangles around fine clutter.
//!
//! Rays in rooms differ from rays around an object: they start inside, all of them hit something, and a few triangles as large as
//! the scene overlap most of its nodes.

use std::fmt;

use glam::DVec3;

use crate::spd::{CameraAndLights, SceneSetup, SpdError, camera_and_lights};
use crate::tessellate::{MeshDraft, UnitSphere};

/// A generated room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Room {
    /// A wide hall with columns, and balls and crates on its floor.
    Hall,
    /// A narrow room with long shelves of books and small ornaments.
    Library,
}

impl Room {
    /// Both rooms.
    pub const ALL: [Self; 2] = [Self::Hall, Self::Library];

    /// The name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hall => "hall",
            Self::Library => "library",
        }
    }

    /// Generates the room with clutter of about `size` thousand triangles, at least one, identical on every platform. Linear in
    /// the number of triangles.
    ///
    /// # Errors
    ///
    /// [`SpdError::Mesh`] beyond the triangles that a mesh can have.
    ///
    /// ```
    /// use kd_scene::Room;
    ///
    /// let room = Room::Hall.generate(3)?;
    /// assert_eq!(room.name, "hall-3");
    /// assert!((2_900..4_000).contains(&room.mesh.len()));
    /// # Ok::<(), kd_scene::SpdError>(())
    /// ```
    pub fn generate(self, size: u32) -> Result<SceneSetup, SpdError> {
        let most = 1000 * size.max(1) as usize;
        let (draft, setup) = match self {
            Self::Hall => hall(most),
            Self::Library => library(most),
        };
        Ok(SceneSetup {
            name: format!("{self}-{size}"),
            mesh: draft.into_mesh()?,
            camera: setup.camera,
            lights: setup.lights,
        })
    }
}

impl fmt::Display for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Numbers between 0 and 1 that fill the interval evenly, in no order: multiples of irrational numbers, one for each use.
struct Even {
    number: f64,
}

impl Even {
    fn next(&mut self) -> [f64; 5] {
        self.number += 1.0;
        // Powers of the root of x^6 = x + 1.
        [
            0.881_271_4,
            0.776_639_3,
            0.684_429_9,
            0.603_168_8,
            0.531_555_4,
        ]
        .map(|step| (self.number * step).fract())
    }
}

/// Adds a box between two corners: twelve triangles.
fn add_box(draft: &mut MeshDraft, low: DVec3, high: DVec3) {
    let corners: Vec<u32> = (0..8)
        .map(|corner| {
            let on = |axis: usize| {
                if corner >> axis & 1 == 0 {
                    low[axis]
                } else {
                    high[axis]
                }
            };
            draft.vertex(DVec3::new(on(0), on(1), on(2)))
        })
        .collect();
    for face in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        draft.quad(face.map(|corner: usize| corners[corner]));
    }
}

fn hall(most: usize) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let size = DVec3::new(20.0, 12.0, 6.0);
    add_box(&mut draft, DVec3::ZERO, size);
    for column in 0..8 {
        let (x, y) = (
            4.0 * f64::from(1 + column % 4),
            3.0 + 6.0 * f64::from(column / 4),
        );
        let half = DVec3::new(0.3, 0.3, 0.0);
        let foot = DVec3::new(x, y, 0.0);
        add_box(&mut draft, foot - half, foot + half + DVec3::Z * size.z);
    }
    let balls = [4, 8, 12].map(UnitSphere::new);
    let mut even = Even { number: 0.0 };
    while draft.triangles() < most {
        let [x, y, height, radius, kind] = even.next();
        let radius = 0.02 + 0.25 * radius * radius;
        // Most lie on the floor.
        let lift = if height < 0.7 {
            0.0
        } else {
            (height - 0.7) * 15.0
        };
        let center = DVec3::new(0.5 + 19.0 * x, 0.5 + 11.0 * y, radius + lift);
        if kind < 0.5 {
            let finer = if kind < 0.1 {
                2
            } else {
                usize::from(kind < 0.25)
            };
            draft.sphere(&balls[finer], center, radius);
        } else {
            let half = radius * DVec3::new(1.0, kind, 1.0);
            add_box(&mut draft, center - half, center + half);
        }
    }
    let setup = camera_and_lights([1.0, 1.0, 2.0], [16.0, 9.0, 1.0], &[[10.0, 6.0, 5.5]]);
    (draft, setup)
}

fn library(most: usize) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let size = DVec3::new(16.0, 4.0, 5.0);
    add_box(&mut draft, DVec3::ZERO, size);
    let ornament = UnitSphere::new(8);
    let boards = 12_u32;
    let ends = |board: u32| {
        // Along both long walls, one above the other.
        let (side, level) = (board % 2, board / 2);
        let y = f64::from(side) * (size.y - 0.4);
        let z = 0.3 + 0.7 * f64::from(level);
        (
            DVec3::new(0.2, y, z),
            DVec3::new(size.x - 0.2, y + 0.4, z + 0.03),
        )
    };
    for board in 0..boards {
        let (low, high) = ends(board);
        add_box(&mut draft, low, high);
    }
    let mut even = Even { number: 0.0 };
    let mut number = 0;
    while draft.triangles() < most {
        let [along, height, depth, width, kind] = even.next();
        let (low, high) = ends(number % boards);
        number += 1;
        let foot = DVec3::new(low.x + along * (high.x - low.x), low.y, high.z);
        if kind < 0.01 {
            let radius = 0.03 + 0.05 * width;
            draft.sphere(&ornament, foot + DVec3::new(0.0, 0.2, radius), radius);
        } else {
            let book = DVec3::new(
                0.004 + 0.01 * width,
                0.2 + 0.15 * depth,
                0.3 + 0.25 * height,
            );
            add_box(&mut draft, foot, foot + book);
        }
    }
    let setup = camera_and_lights([0.8, 2.0, 2.2], [15.0, 2.3, 1.6], &[[8.0, 2.0, 4.7]]);
    (draft, setup)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn rooms_have_walls_around_their_clutter_and_cameras_inside() {
        for room in Room::ALL {
            let small = room.generate(2).expect("small");
            let setup = room.generate(20).expect("within the limits");
            assert_eq!(setup.name, format!("{room}-20"));
            let triangles = setup.mesh.len();
            assert!((20_000..22_500).contains(&triangles), "{room}: {triangles}");
            assert_eq!(
                small.mesh.bounds(),
                setup.mesh.bounds(),
                "{room}: the walls"
            );
            let inside = |at: Vec3| {
                let bounds = setup.mesh.bounds();
                at.cmpgt(bounds.min).all() && at.cmplt(bounds.max).all()
            };
            let camera = setup.camera.eye;
            assert!(inside(camera) && inside(setup.lights[0]), "{room}");
        }
    }
}
