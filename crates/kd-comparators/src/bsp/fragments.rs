//! Fragments: convex polygons that planes cut out of triangles.

use glam::DVec3;
use kd_core::Mesh;

use super::plane::{Plane, Side};

/// A list of fragments with corners in f64. One allocation holds all corners: most fragments have three or four, and any number
/// is possible.
#[derive(Clone, Debug, Default)]
pub(super) struct Fragments {
    triangles: Vec<u32>,
    /// End of each fragment's corners, where those of the next fragment begin.
    ends: Vec<usize>,
    corners: Vec<DVec3>,
}

/// Fragments on the sides of a plane.
#[derive(Clone, Debug, Default)]
pub(super) struct Sides {
    pub(super) behind: Fragments,
    pub(super) in_front: Fragments,
    /// The triangles in the plane.
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

    /// The triangle of each fragment.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// The corners of a fragment, in order around it.
    pub(super) fn corners(&self, number: usize) -> &[DVec3] {
        let start = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.corners[start..self.ends[number]]
    }

    /// The largest absolute value of a coordinate.
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

    /// Ends a fragment after the corners added last.
    fn end(&mut self, triangle: u32) {
        self.triangles.push(triangle);
        self.ends.push(self.corners.len());
    }

    /// Sorts fragments to the sides of a plane, and cuts those across it.
    ///
    /// Corners within `tolerance` of the plane count for neither side, so that no fragment is thinner than that. They belong to
    /// both halves of a cut fragment.
    pub(super) fn sides_of(&self, plane: &Plane, tolerance: f64) -> Sides {
        let mut sides = Sides::default();
        for (number, &triangle) in self.triangles.iter().enumerate() {
            let corners = self.corners(number);
            match plane.side_of(corners, tolerance) {
                Side::Behind => sides.behind.push(triangle, corners),
                Side::InFront => sides.in_front.push(triangle, corners),
                Side::On => sides.on.push(triangle),
                Side::Across => sides.cut(triangle, corners, plane, tolerance),
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
                // Both halves share one point, so that no gap is between them.
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
    fn halves_add_up_and_are_on_their_sides() {
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
        let halves = [&sides.behind, &sides.in_front];
        assert_eq!(halves.map(Fragments::triangles), [[0]; 2], "one each");
        let areas = halves.map(|half| area(half.corners(0)));
        let sum = area(whole.corners(0));
        assert!(
            (areas[0] + areas[1] - sum).abs() < 1e-12,
            "{areas:?}, {sum}"
        );
        let side = |half: &Fragments| plane.side_of(half.corners(0), 1e-9);
        let expected = [Side::Behind, Side::InFront];
        assert_eq!(halves.map(side), expected, "on their sides");
        // The plane passes through a corner, which belongs to both.
        assert_eq!(
            halves.map(|half| half.corners(0).len()),
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
