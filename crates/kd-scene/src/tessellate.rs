//! Tessellation of spheres and cones, at the resolution that the SPD tools use.
//!
//! A sphere is a projected cube: six faces of r × r cells on a grid of equal angles, 12 r² triangles, welded along the edges of
//! the cube. A cone or cylinder has 4 r sides of two triangles and no caps. Triangles are counter-clockwise as seen from
//! outside.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_4, TAU};

use glam::DVec3;
use kd_core::{Mesh, MeshError};

/// The resolution of all scenes except jacks.
pub(crate) const RESOLUTION: u32 = 4;

/// A mesh under construction. It stores positions rounded to `f32`.
#[derive(Default)]
pub(crate) struct MeshDraft {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl MeshDraft {
    /// Adds a vertex, and returns its index.
    pub(crate) fn vertex(&mut self, position: DVec3) -> u32 {
        let index = u32::try_from(self.positions.len());
        self.positions.push(position.as_vec3().to_array());
        index.expect("a scene within its limit of triangles has far fewer than 2^32 vertices")
    }

    /// The number of triangles.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles.len()
    }

    pub(crate) fn triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
    }

    /// Adds two triangles that share the diagonal from the first to the third corner.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// Adds a square of side `2 * half` around `center`, perpendicular to z, facing +z.
    pub(crate) fn floor(&mut self, center: DVec3, half: f64) {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corners = corners.map(|(x, y)| center + half * DVec3::new(x, y, 0.0));
        let corners = corners.map(|corner| self.vertex(corner));
        self.quad(corners);
    }

    /// Adds a scaled copy of the unit sphere around `center`.
    pub(crate) fn sphere(&mut self, unit: &UnitSphere, center: DVec3, radius: f64) {
        let position = |&direction: &DVec3| center + radius * direction;
        let base = u32::try_from(self.positions.len());
        let base =
            base.expect("a scene within its limit of triangles has far fewer than 2^32 vertices");
        let positions = unit.directions.iter().map(position);
        self.positions
            .extend(positions.map(|position| position.as_vec3().to_array()));
        let triangles = unit.triangles.iter();
        self.triangles
            .extend(triangles.map(|corners| corners.map(|corner| base + corner)));
    }

    /// Adds the side of a cone from the circle `base` to the circle `tip`, each a center and a radius. The centers must differ.
    pub(crate) fn cone(&mut self, resolution: u32, base: (DVec3, f64), tip: (DVec3, f64)) {
        let ring: Vec<[u32; 2]> = circle_directions(tip.0 - base.0, resolution)
            .map(|outwards| {
                [base, tip].map(|(center, radius)| self.vertex(center + radius * outwards))
            })
            .collect();
        for (side, &[low, high]) in ring.iter().enumerate() {
            let [next_low, next_high] = ring[(side + 1) % ring.len()];
            self.quad([low, next_low, next_high, high]);
        }
    }

    pub(crate) fn into_mesh(self) -> Result<Mesh, MeshError> {
        Mesh::new(self.positions, self.triangles)
    }
}

/// `4 * resolution` unit vectors perpendicular to an axis, at equal angles around it.
pub(crate) fn circle_directions(axis: DVec3, resolution: u32) -> impl Iterator<Item = DVec3> {
    let (across, along) = axis.normalize().any_orthonormal_pair();
    let sides = 4 * resolution;
    (0..sides).map(move |side| {
        let (sine, cosine) = libm::sincos(TAU * f64::from(side) / f64::from(sides));
        cosine * across + sine * along
    })
}

/// A tessellated sphere of radius 1 around the origin, made once and copied.
pub(crate) struct UnitSphere {
    pub(crate) directions: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl UnitSphere {
    pub(crate) fn new(resolution: u32) -> Self {
        // Equal angles along an edge of the cube, with exact values at the corners.
        let coordinate = |step: u32| match step {
            0 => -1.0,
            _ if step == resolution => 1.0,
            _ => libm::tan(FRAC_PI_4 * (2.0 * f64::from(step) / f64::from(resolution) - 1.0)),
        };
        let mut sphere = Self {
            directions: Vec::new(),
            triangles: Vec::new(),
        };
        // The position on the grid of the cube identifies a vertex, so adjacent faces share vertices.
        let mut vertices = HashMap::new();
        for axis in 0..3 {
            for step in [0, resolution] {
                let mut point = |u: u32, v: u32| {
                    let mut cell = [0; 3];
                    cell[axis] = step;
                    cell[(axis + 1) % 3] = u;
                    cell[(axis + 2) % 3] = v;
                    *vertices.entry(cell).or_insert_with(|| {
                        sphere
                            .directions
                            .push(DVec3::from(cell.map(coordinate)).normalize());
                        sphere.directions.len() - 1
                    })
                };
                for u in 0..resolution {
                    for v in 0..resolution {
                        let [a, b, c, d] = [
                            point(u, v),
                            point(u + 1, v),
                            point(u + 1, v + 1),
                            point(u, v + 1),
                        ]
                        .map(|index| u32::try_from(index).expect("a few hundred directions"));
                        let is_reversed = step == 0;
                        let quad = if is_reversed {
                            [d, c, b, a]
                        } else {
                            [a, b, c, d]
                        };
                        sphere.triangles.push([quad[0], quad[1], quad[2]]);
                        sphere.triangles.push([quad[0], quad[2], quad[3]]);
                    }
                }
            }
        }
        sphere
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that every edge occurs once in each direction: the mesh is closed, welded and consistently oriented.
    #[track_caller]
    fn assert_closed(mesh: &Mesh) {
        let mut edges = HashMap::new();
        for &[a, b, c] in mesh.triangles() {
            for edge in [[a, b], [b, c], [c, a]] {
                assert!(
                    edges.insert(edge, ()).is_none(),
                    "edge {edge:?} occurs twice"
                );
            }
        }
        for [from, to] in edges.keys() {
            assert!(
                edges.contains_key(&[*to, *from]),
                "edge {from} {to} has one face"
            );
        }
    }

    fn volume(mesh: &Mesh) -> f64 {
        let corners = |index: u32| mesh.corners(index).map(|corner| corner.as_dvec3());
        let count = u32::try_from(mesh.len()).expect("a small mesh");
        let volumes = (0..count)
            .map(corners)
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0);
        volumes.sum()
    }

    #[test]
    fn spheres_are_closed_and_round() {
        for (resolution, triangles, fill) in
            [(1, 12, 0.3), (2, 48, 0.7), (4, 192, 0.9), (9, 972, 0.98)]
        {
            let mut draft = MeshDraft::default();
            let center = DVec3::new(1.0, -2.0, 0.5);
            draft.sphere(&UnitSphere::new(resolution), center, 3.0);
            let mesh = draft.into_mesh().expect("a mesh");
            assert_eq!(mesh.len(), triangles, "resolution {resolution}");
            assert_eq!(mesh.positions().len(), triangles / 2 + 2, "Euler's formula");
            assert_closed(&mesh);
            for &position in mesh.positions() {
                let position = DVec3::from(position.map(f64::from));
                assert!(
                    ((position - center).length() - 3.0).abs() < 1e-6,
                    "{position}"
                );
            }
            let ball = 4.0 / 3.0 * std::f64::consts::PI * 27.0;
            let share = volume(&mesh) / ball;
            assert!(
                share > fill && share < 1.0,
                "share {share} of the volume of the ball"
            );
        }
    }

    #[test]
    fn cones_have_the_expected_area_and_face_outwards() {
        let mut draft = MeshDraft::default();
        let (base, tip) = (DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 4.0));
        draft.cone(RESOLUTION, (base, 0.5), (tip, 0.25));
        let mesh = draft.into_mesh().expect("a mesh");
        assert_eq!((mesh.len(), mesh.positions().len()), (32, 32));
        let mut area = 0.0;
        for index in 0..32 {
            let [a, b, c] = mesh.corners(index).map(|corner| corner.as_dvec3());
            let normal = (b - a).cross(c - a);
            area += normal.length() / 2.0;
            let middle = (a + b + c) / 3.0;
            let on_axis = base + (tip - base) * (middle - base).dot(tip - base) / 25.0;
            assert!(
                normal.dot(middle - on_axis) > 0.0,
                "triangle {index} faces inwards"
            );
        }
        let smooth = std::f64::consts::PI * 0.75 * libm::hypot(5.0, 0.25);
        assert!(
            (0.98..1.0).contains(&(area / smooth)),
            "area {area} of {smooth}"
        );
    }
}
