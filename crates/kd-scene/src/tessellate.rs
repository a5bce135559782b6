//! Primitives to triangles, at the resolution the SPD tools use.
//!
//! A sphere is a cube blown up: six faces of r x r cells on a grid of equal angles, 12 r^2
//! triangles, welded along the cube's edges. A cone or cylinder has 4 r sides of two triangles and
//! no caps. Faces turn counter-clockwise as seen from outside.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_4, TAU};

use glam::DVec3;
use kd_core::{Mesh, MeshError};

/// The resolution of all scenes but jacks.
pub(crate) const RESOLUTION: u32 = 4;

/// A mesh in the making. Positions are rounded to `f32` on the way in.
#[derive(Default)]
pub(crate) struct Draft {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Draft {
    pub(crate) fn vertex(&mut self, position: DVec3) -> u32 {
        let index = u32::try_from(self.positions.len());
        self.positions.push(position.as_vec3().to_array());
        index.expect("a scene within its limit of triangles has far fewer than 2^32 vertices")
    }

    pub(crate) fn triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
    }

    /// Two triangles that share the diagonal from the first corner to the third.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// A square of side `2 * half` around `center`, at a right angle to z, facing up.
    pub(crate) fn floor(&mut self, center: DVec3, half: f64) {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corners = corners.map(|(x, y)| center + half * DVec3::new(x, y, 0.0));
        let corners = corners.map(|corner| self.vertex(corner));
        self.quad(corners);
    }

    pub(crate) fn sphere(&mut self, unit: &UnitSphere, center: DVec3, radius: f64) {
        let place = |&direction: &DVec3| center + radius * direction;
        let base = u32::try_from(self.positions.len());
        let base =
            base.expect("a scene within its limit of triangles has far fewer than 2^32 vertices");
        let positions = unit.directions.iter().map(place);
        self.positions
            .extend(positions.map(|position| position.as_vec3().to_array()));
        let triangles = unit.triangles.iter();
        self.triangles
            .extend(triangles.map(|corners| corners.map(|corner| base + corner)));
    }

    /// The side of a cone from a circle around `base` to one around `tip`. The ends must differ.
    pub(crate) fn cone(&mut self, resolution: u32, base: (DVec3, f64), tip: (DVec3, f64)) {
        let ring: Vec<[u32; 2]> = around(tip.0 - base.0, resolution)
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

/// Unit vectors at right angles to an axis, all the way round: of a cone or a cylinder.
pub(crate) fn around(axis: DVec3, resolution: u32) -> impl Iterator<Item = DVec3> {
    let (across, along) = axis.normalize().any_orthonormal_pair();
    let sides = 4 * resolution;
    (0..sides).map(move |side| {
        let (sine, cosine) = libm::sincos(TAU * f64::from(side) / f64::from(sides));
        cosine * across + sine * along
    })
}

/// A tessellated sphere of radius 1 around the origin, made once and placed many times.
pub(crate) struct UnitSphere {
    pub(crate) directions: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl UnitSphere {
    pub(crate) fn new(resolution: u32) -> Self {
        // Equal angles along an edge of the cube; its ends exactly at the corners.
        let coordinate = |step: u32| match step {
            0 => -1.0,
            _ if step == resolution => 1.0,
            _ => libm::tan(FRAC_PI_4 * (2.0 * f64::from(step) / f64::from(resolution) - 1.0)),
        };
        let mut sphere = Self {
            directions: Vec::new(),
            triangles: Vec::new(),
        };
        // Points are known by their place on the cube's grid: faces meet in the same vertices.
        let mut known = HashMap::new();
        for axis in 0..3 {
            for step in [0, resolution] {
                let mut point = |u: u32, v: u32| {
                    let mut place = [0; 3];
                    place[axis] = step;
                    place[(axis + 1) % 3] = u;
                    place[(axis + 2) % 3] = v;
                    *known.entry(place).or_insert_with(|| {
                        sphere
                            .directions
                            .push(DVec3::from(place.map(coordinate)).normalize());
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
                        let inwards = step == 0;
                        let quad = if inwards { [d, c, b, a] } else { [a, b, c, d] };
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

    /// Every edge once in each direction: closed, welded, all faces turning the same way.
    #[track_caller]
    fn assert_closed(mesh: &Mesh) {
        let mut edges = HashMap::new();
        for &[a, b, c] in mesh.triangles() {
            for edge in [[a, b], [b, c], [c, a]] {
                assert!(
                    edges.insert(edge, ()).is_none(),
                    "edge {edge:?} is used twice"
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
            let mut draft = Draft::default();
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
                "share {share}: outward faces give volume"
            );
        }
    }

    #[test]
    fn cones_have_the_right_area_and_face_outwards() {
        let mut draft = Draft::default();
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
