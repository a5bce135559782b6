//! Convex parts of triangles, as planes cut them.

use glam::DVec3;
use kd_core::Mesh;

use super::plane::{Lies, Plane};

/// A list of fragments, corners in f64. One allocation for all corners: fragments have three or four of them mostly, and may
/// have any number.
#[derive(Clone, Debug, Default)]
pub(super) struct Fragments {
    triangles: Vec<u32>,
    /// Where each one's corners end. Those of the next one begin there.
    ends: Vec<usize>,
    corners: Vec<DVec3>,
}

/// Fragments on the sides of a plane.
#[derive(Clone, Debug, Default)]
pub(super) struct Sides {
    pub(super) behind: Fragments,
    pub(super) in_front: Fragments,
    /// The triangles of those in the plane.
    pub(super) on: Vec<u32>,
}

impl Fragments {
    /// All triangles of a mesh, whole.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let mut all = Self::default();
        for (triangle, _) in (0..).zip(mesh.triangles()) {
            all.push(triangle, &mesh.corners(triangle).map(|p| p.as_dvec3()));
        }
        all
    }

    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// The triangle that each is part of.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// The corners of one, in order around it.
    pub(super) fn corners(&self, number: usize) -> &[DVec3] {
        let start = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.corners[start..self.ends[number]]
    }

    /// The largest coordinate, whatever its sign.
    pub(super) fn largest_coordinate(&self) -> f64 {
        let corners = self.corners.iter();
        corners.fold(0.0, |largest, corner| {
            largest.max(corner.abs().max_element())
        })
    }

    fn push(&mut self, triangle: u32, corners: &[DVec3]) {
        self.corners.extend_from_slice(corners);
        self.end(triangle);
    }

    /// Makes a fragment of the corners that were added last.
    fn end(&mut self, triangle: u32) {
        self.triangles.push(triangle);
        self.ends.push(self.corners.len());
    }

    /// Sorts all to the sides of a plane, and cuts those across it.
    ///
    /// Corners within `tolerance` of the plane count for neither side, so that no fragment is thinner than that, and belong to
    /// both parts of what is cut.
    pub(super) fn sides_of(&self, plane: &Plane, tolerance: f64) -> Sides {
        let mut sides = Sides::default();
        for (number, &triangle) in self.triangles.iter().enumerate() {
            let corners = self.corners(number);
            match plane.side_of(corners, tolerance) {
                Lies::Behind => sides.behind.push(triangle, corners),
                Lies::InFront => sides.in_front.push(triangle, corners),
                Lies::On => sides.on.push(triangle),
                Lies::Across => sides.cut(triangle, corners, plane, tolerance),
            }
        }
        sides
    }
}

impl Sides {
    fn cut(&mut self, triangle: u32, corners: &[DVec3], plane: &Plane, tolerance: f64) {
        let Some(&last) = corners.last() else {
            return;
        };
        let (mut from, mut from_height) = (last, plane.height(last));
        for &to in corners {
            let to_height = plane.height(to);
            let is_crossing = (from_height < -tolerance && to_height > tolerance)
                || (from_height > tolerance && to_height < -tolerance);
            if is_crossing {
                // One point for both parts, so that nothing lies between them.
                let point = from + (to - from) * (from_height / (from_height - to_height));
                self.behind.corners.push(point);
                self.in_front.corners.push(point);
            }
            if to_height <= tolerance {
                self.behind.corners.push(to);
            }
            if to_height >= -tolerance {
                self.in_front.corners.push(to);
            }
            (from, from_height) = (to, to_height);
        }
        self.behind.end(triangle);
        self.in_front.end(triangle);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn area(corners: &[DVec3]) -> f64 {
        let fan = corners.windows(2).skip(1);
        let areas = fan.map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]).length());
        0.5 * areas.sum::<f64>()
    }

    #[test]
    fn parts_add_up_and_lie_on_their_sides() {
        let corners = vec![
            [-1.0, -1.0, 0.0],
            [3.0, 0.0, 1.0],
            [0.0, 2.0, -1.0],
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let mesh = Mesh::new(corners, vec![[0, 1, 2], [3, 4, 5]]).expect("valid");
        let plane = Plane::of(mesh.corners(1)).expect("not a line");
        let whole = Fragments::of(&mesh);
        let sides = whole.sides_of(&plane, 1e-9);
        assert_eq!(sides.on, [1], "its own plane");
        let parts = [&sides.behind, &sides.in_front];
        assert_eq!(parts.map(Fragments::triangles), [[0]; 2], "a part each");
        let areas = parts.map(|part| area(part.corners(0)));
        let sum = area(whole.corners(0));
        assert!(
            (areas[0] + areas[1] - sum).abs() < 1e-12,
            "{areas:?}, {sum}"
        );
        let side = |part: &Fragments| plane.side_of(part.corners(0), 1e-9);
        let expected = [Lies::Behind, Lies::InFront];
        assert_eq!(parts.map(side), expected, "on their sides");
        // The plane runs through a corner, which belongs to both.
        assert_eq!(
            parts.map(|part| part.corners(0).len()),
            [3, 3],
            "two triangles"
        );
    }

    #[test]
    fn corners_near_the_plane_are_not_cut_off() {
        let corners = vec![[0.0, 0.0, 1e-7], [1.0, 0.0, -2.0], [0.0, 1.0, -1.0]];
        let mesh = Mesh::new(corners, vec![[0, 1, 2]]).expect("valid");
        let plane = Plane::of([Vec3::ZERO, Vec3::X, Vec3::Y]).expect("not a line");
        let sides = Fragments::of(&mesh).sides_of(&plane, 1e-6);
        let counts = (sides.behind.len(), sides.in_front.len(), sides.on.len());
        assert_eq!(counts, (1, 0, 0), "within the tolerance");
        let sides = Fragments::of(&mesh).sides_of(&plane, 1e-8);
        let counts = (sides.behind.len(), sides.in_front.len(), sides.on.len());
        assert_eq!(counts, (1, 1, 0), "beyond it");
    }
}
