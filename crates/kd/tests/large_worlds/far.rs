//! Closed meshes 10⁷ from zero: no ray from inside leaves them.

use kd::glam::{DVec3, Vec3};
use kd::world::WorldRay;
use kd::{KdTree, Mesh, Ray};
use kd_oracle::watertight::{check_closed, points};
use kd_oracle::{scenes, watertight};

use crate::{LAYOUTS, tree, world};

const FAR: [f32; 3] = [1e7, -1e7, 1e7];

/// Hits of a ray, by each query.
fn hits(tree: &KdTree, ray: &Ray) -> usize {
    let mut hits = Vec::new();
    tree.hits(ray, usize::MAX, &mut hits);
    assert_eq!(tree.intersect(ray), hits.first().copied(), "{ray:?}");
    assert_eq!(tree.occluded(ray), !hits.is_empty(), "{ray:?}");
    hits.len()
}

/// Coordinates are whole numbers there: shapes are coarse, and closed.
#[test]
fn f32_meshes_far_away_are_watertight() {
    for (name, mesh, radius) in [
        ("sphere", scenes::sphere(2), 0.9),
        ("cube", scenes::cube(4), 0.99),
        ("bumpy", scenes::bumpy(), 0.45),
    ] {
        for size in [200.0, 6000.0] {
            let far = |p: Vec3| size * p + Vec3::from(FAR);
            let mesh = scenes::moved(&mesh, far);
            let inside: Vec<Vec3> = points(radius).into_iter().map(far).collect();
            for layout in LAYOUTS {
                let tree = tree(mesh.clone(), layout);
                let name = format!("{name} of {size}, {layout:?}");
                check_closed(&name, &mesh, &inside, |ray| hits(&tree, ray));
            }
        }
    }
}

/// Small shapes given in f64, which f32 alone would collapse to points.
#[test]
fn f64_meshes_far_away_are_watertight() {
    for (name, near, inside) in watertight::closed_meshes().into_iter().take(4) {
        let far = DVec3::from(FAR.map(f64::from)) + 0.25;
        let shape = |p: Vec3| far + 0.125 * p.as_dvec3();
        let positions = near.positions().iter();
        let positions: Vec<[f64; 3]> = positions
            .map(|position| shape(Vec3::from(*position)).to_array())
            .collect();
        let mesh = Mesh::from_f64(&positions, near.triangles().to_vec()).expect("valid");
        for layout in LAYOUTS {
            let world = world(mesh.clone(), layout);
            check_closed(&name, &near, &inside, |ray| {
                let ray = WorldRay::new(shape(ray.origin), 0.125 * ray.direction)
                    .with_range(ray.t_min, ray.t_max);
                hits(&world.structure, &ray.relative_to(world.origin))
            });
        }
    }
}
