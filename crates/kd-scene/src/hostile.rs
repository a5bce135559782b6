//! Meshes that ruin builds: triangles that no plane separates, or that every plane cuts.
//!
//! Each has a given number of triangles, so that its build can be compared with that of a sphere of as many.

use std::f32::consts::{PI, TAU};
use std::fmt;

use fastrand::Rng;
use glam::Vec3;
use kd_core::{Mesh, MeshError};

/// A generated mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Hostile {
    /// Triangles with random corners in one plane.
    Coplanar,
    /// Small triangles at random places in one plane.
    Confetti,
    /// Thin triangles of unit length along the axes, at random places in a cube.
    Needles,
    /// Thin triangles in random directions, at random places in a cube.
    Slivers,
    /// Triangles with random corners in a cube.
    Overlapping,
    /// One triangle again and again.
    Equal,
    /// Triangles whose corners are on lines, and so of no area.
    Lines,
    /// All corners on one line.
    OneLine,
    /// A disk of thin triangles that share their center.
    Fan,
    /// Two clusters 10³⁰ apart.
    FarApart,
    /// A sphere, and one triangle far larger.
    OneSpansAll,
    /// A sphere, and lines of no area all over it, one for 25 triangles.
    SphereAndLines,
}

impl Hostile {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Coplanar,
        Self::Confetti,
        Self::Needles,
        Self::Slivers,
        Self::Overlapping,
        Self::Equal,
        Self::Lines,
        Self::OneLine,
        Self::Fan,
        Self::FarApart,
        Self::OneSpansAll,
        Self::SphereAndLines,
    ];

    /// The name in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coplanar => "coplanar triangles",
            Self::Confetti => "coplanar confetti",
            Self::Needles => "needles",
            Self::Slivers => "slivers",
            Self::Overlapping => "overlapping triangles",
            Self::Equal => "equal triangles",
            Self::Lines => "lines",
            Self::OneLine => "one line",
            Self::Fan => "fan",
            Self::FarApart => "two clusters",
            Self::OneSpansAll => "sphere and one that spans all",
            Self::SphereAndLines => "sphere and lines",
        }
    }

    /// Generates the mesh with about `triangles`, at least eight, identical on every platform. Linear.
    ///
    /// # Errors
    ///
    /// [`MeshError::TooLarge`] beyond the triangles that a mesh can have.
    ///
    /// ```
    /// use kd_scene::Hostile;
    ///
    /// let mesh = Hostile::Lines.generate(100)?;
    /// assert_eq!((mesh.len(), mesh.zero_area_count()), (100, 100));
    /// # Ok::<(), kd_core::MeshError>(())
    /// ```
    pub fn generate(self, triangles: usize) -> Result<Mesh, MeshError> {
        let mut draft = Draft::default();
        let rng = &mut Rng::with_seed(7);
        let count = triangles.max(8);
        match self {
            Self::Coplanar => draft.fill(count, |_| [flat(rng), flat(rng), flat(rng)]),
            Self::Confetti => draft.fill(count, |_| {
                let place = flat(rng);
                [(); 3].map(|()| place + 0.02 * flat(rng))
            }),
            Self::Needles => draft.fill(count, |number| {
                let (from, along) = (point(rng), Vec3::AXES[number % 3]);
                [from, from + along, from + 0.5 * along + 1e-3 * point(rng)]
            }),
            Self::Slivers => draft.fill(count, |_| {
                let (from, along) = (point(rng), point(rng) - 0.5);
                [from, from + 2.0 * along, from + along + 1e-3 * point(rng)]
            }),
            Self::Overlapping => draft.fill(count, |_| [point(rng), point(rng), point(rng)]),
            Self::Equal => draft.fill(count, |_| [Vec3::ZERO, Vec3::X, Vec3::Y]),
            Self::Lines => draft.fill(count, |_| line(rng)),
            Self::OneLine => draft.fill(count, |_| {
                let from = rng.f32();
                [0.0, 0.01, 0.02].map(|step| (from + step) * Vec3::X)
            }),
            Self::Fan => draft.fill(count, |number| {
                let rim = |number: usize| {
                    let angle = TAU * number as f32 / count as f32;
                    Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0)
                };
                [Vec3::ZERO, rim(number), rim(number + 1)]
            }),
            Self::FarApart => draft.fill(count, |number| {
                let place = if number % 2 == 0 {
                    Vec3::ZERO
                } else {
                    Vec3::splat(1e30)
                };
                let size = if number % 2 == 0 { 1.0 } else { 1e29 };
                [(); 3].map(|()| place + size * point(rng))
            }),
            Self::OneSpansAll => {
                draft.sphere(count - 1);
                let far = [
                    [-100.0, -100.0, -100.0],
                    [100.0, 100.0, 100.0],
                    [100.0, -100.0, 50.0],
                ];
                draft.triangle(far.map(Vec3::from));
            }
            Self::SphereAndLines => {
                draft.sphere(count - count / 25);
                draft.fill(count / 25, |_| line(rng).map(|corner| 2.0 * corner - 1.0));
            }
        }
        Mesh::new(draft.positions, draft.triangles)
    }

    /// The sphere whose build is the measure of theirs.
    ///
    /// # Errors
    ///
    /// As [`generate`](Self::generate).
    pub fn sphere(triangles: usize) -> Result<Mesh, MeshError> {
        let mut draft = Draft::default();
        draft.sphere(triangles.max(8));
        Mesh::new(draft.positions, draft.triangles)
    }
}

impl fmt::Display for Hostile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// In the unit cube.
fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32(), rng.f32(), rng.f32())
}

/// In the unit square.
fn flat(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32(), rng.f32(), 0.0)
}

/// Three points of a line, exactly: on a grid of powers of two.
fn line(rng: &mut Rng) -> [Vec3; 3] {
    let on_grid = |point: Vec3| (1024.0 * point).round() / 1024.0;
    let (middle, step) = (on_grid(point(rng)), on_grid(point(rng) - 0.5));
    [middle, middle + step, middle - step]
}

#[derive(Default)]
struct Draft {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Draft {
    fn next(&self) -> u32 {
        u32::try_from(self.positions.len()).expect("few vertices")
    }

    fn triangle(&mut self, corners: [Vec3; 3]) {
        let first = self.next();
        self.positions
            .extend(corners.map(|corner| corner.to_array()));
        self.triangles.push([first, first + 1, first + 2]);
    }

    fn fill(&mut self, count: usize, mut corners: impl FnMut(usize) -> [Vec3; 3]) {
        for number in 0..count {
            self.triangle(corners(number));
        }
    }

    /// A unit sphere of rings, with at most this number of triangles; those at the poles have no area.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the root of a count"
    )]
    fn sphere(&mut self, most: usize) {
        let (first, rings) = (self.next(), (most as f64 / 2.0).sqrt() as u32);
        for (ring, place) in
            (0..=rings).flat_map(|ring| (0..=rings).map(move |place| (ring, place)))
        {
            let polar = PI * ring as f32 / rings as f32;
            let angle = TAU * place as f32 / rings as f32;
            let radius = libm::sinf(polar);
            let point = [
                radius * libm::cosf(angle),
                radius * libm::sinf(angle),
                libm::cosf(polar),
            ];
            self.positions.push(point);
        }
        for (ring, place) in (0..rings).flat_map(|ring| (0..rings).map(move |place| (ring, place)))
        {
            let a = first + ring * (rings + 1) + place;
            let below = a + rings + 1;
            self.triangles.push([a, a + 1, below]);
            self.triangles.push([a + 1, below + 1, below]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_about_as_asked() {
        for count in [8, 100, 3000] {
            for hostile in Hostile::ALL {
                let mesh = hostile.generate(count).expect("small");
                let len = mesh.len();
                assert!(
                    len <= count && len + len / 4 + 8 >= count,
                    "{hostile}: {len} of {count}"
                );
            }
            let sphere = Hostile::sphere(count).expect("small").len();
            assert!(sphere <= count, "{sphere} of {count}");
        }
    }

    #[test]
    fn lines_have_no_area_exactly() {
        for (hostile, least) in [(Hostile::Lines, 1000), (Hostile::SphereAndLines, 40)] {
            let mesh = hostile.generate(1000).expect("small");
            assert!(
                mesh.zero_area_count() >= least,
                "{hostile}: {}",
                mesh.zero_area_count()
            );
        }
    }
}
