//! Estimates compared with counts of all references.

use kd_core::{Axis, Mesh, Tree};
use kd_merge::{Census, Sides, estimate};
use kd_sah::{BuildOptions, build};
use kd_scene::Spd;

/// Counts references by side, from the boxes of their primitives. (The estimate may count a reference on the side of its
/// leaf's cell although the plane cuts its primitive; this count does not.)
fn count(tree: &Tree, mesh: &Mesh, axis: Axis, position: f32) -> Sides {
    let mut sides = Sides::default();
    for slot in tree.refs() {
        let corners = mesh.corners(slot.0).map(|corner| corner[axis.index()]);
        let (min, max) = corners
            .iter()
            .fold((f32::MAX, f32::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        if max <= position {
            sides.left += 1.0;
        } else if min >= position {
            sides.right += 1.0;
        } else {
            sides.on += 1.0;
        }
    }
    sides
}

/// The largest difference, as a fraction of all references.
fn error(found: &Sides, exact: &Sides) -> f64 {
    let differences = [
        found.left - exact.left,
        found.right - exact.right,
        found.on - exact.on,
    ];
    let largest = differences.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    largest / exact.total().max(1.0)
}

/// The errors of 20 planes for each axis, sorted.
fn errors(mesh: &Mesh, visits: usize) -> Vec<f64> {
    let tree = build(mesh, &BuildOptions::balanced()).expect("valid");
    let mut census = Census::new();
    census.extend(tree.nodes());
    let bounds = mesh.bounds();
    let mut errors = Vec::new();
    for axis in Axis::ALL {
        // Positions avoid planes of symmetry that contain triangles: the tree chose a side for these.
        for share in 0_u8..20 {
            let size = bounds.extent()[axis.index()];
            let position = bounds.min[axis.index()] + (f32::from(share) + 0.37) / 20.0 * size;
            let found = estimate(&tree, &census, mesh, axis, position, visits);
            assert!(
                (found.total() - tree.refs().len() as f64).abs() < 1e-3 * found.total(),
                "{found:?}: the sides add up to all references"
            );
            errors.push(error(&found, &count(&tree, mesh, axis, position)));
        }
    }
    errors.sort_by(f64::total_cmp);
    errors
}

/// The table in the documentation of `estimate`: median and largest error as fractions of all references.
#[test]
fn errors_are_as_documented() {
    for (name, spd, size) in [
        ("balls", Spd::Balls, 2),
        ("gears", Spd::Gears, 2),
        ("mount", Spd::Mount, 5),
    ] {
        let mesh = spd.generate(size).expect("small").mesh;
        for (visits, most_median, most) in [
            (1, 0.25, 0.55),
            (8, 0.11, 0.55),
            (64, 0.002, 0.3),
            (512, 0.002, 0.17),
            (usize::MAX, 0.002, 0.17),
        ] {
            let errors = errors(&mesh, visits);
            let (median, largest) = (errors[errors.len() / 2], errors[errors.len() - 1]);
            assert!(
                median <= most_median && largest <= most,
                "{name}, {visits} visits: {median:.4}, at most {largest:.4}"
            );
        }
    }
}

#[test]
fn a_plane_outside_the_bounds_has_all_references_on_one_side() {
    let mesh = Spd::Tetra.generate(3).expect("small").mesh;
    let tree = build(&mesh, &BuildOptions::balanced()).expect("valid");
    let mut census = Census::new();
    census.extend(tree.nodes());
    let all = tree.refs().len() as f64;
    for axis in Axis::ALL {
        let bounds = mesh.bounds();
        let below = estimate(&tree, &census, &mesh, axis, bounds.min[axis.index()], 4);
        assert_eq!(
            (below.left, below.right, below.on),
            (0.0, all, 0.0),
            "{axis:?}"
        );
        let above = estimate(&tree, &census, &mesh, axis, bounds.max[axis.index()], 4);
        assert_eq!(
            (above.left, above.right, above.on),
            (all, 0.0, 0.0),
            "{axis:?}"
        );
    }
}
