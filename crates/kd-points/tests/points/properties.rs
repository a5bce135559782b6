//! Random small meshes on lattices, with triangles twice, in one plane and without area.

use glam::Vec3;
use kd_core::Aabb;
use kd_oracle::{effort, strategies};
use kd_points::{brute_force, closest_point, contains, triangles_in_box, triangles_in_sphere};
use proptest::prelude::*;

use crate::hard::Trees;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(200, 3000)))]

    #[test]
    fn every_query_equals_brute_force(
        mesh in strategies::mesh(),
        points in prop::collection::vec(strategies::point(), 1..12),
        corner in strategies::point(),
        size in prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..3.0],
        scale in prop_oneof![4 => Just(1.0_f32), 1 => Just(1e-25), 1 => Just(1e25), 1 => Just(3.0)],
    ) {
        let mesh = kd_oracle::scenes::moved(&mesh, |p| p * scale);
        let trees = Trees::new(&mesh);
        for point in points {
            let point = point * scale;
            let nearest = brute_force::closest_point(&mesh, point, f32::INFINITY);
            let near = brute_force::closest_point(&mesh, point, size * scale);
            let is_inside = brute_force::contains(&mesh, point);
            let (mut expected, mut found) = (Vec::new(), Vec::new());
            for (tree, trees) in trees.all() {
                prop_assert_eq!(closest_point(&trees, point, f32::INFINITY), nearest, "{} {}", &tree, point);
                prop_assert_eq!(closest_point(&trees, point, size * scale), near, "{} {}", &tree, point);
                prop_assert_eq!(contains(&trees, point), is_inside, "{} {}", &tree, point);
                brute_force::triangles_in_sphere(&mesh, point, size * scale, &mut expected);
                triangles_in_sphere(&trees, point, size * scale, &mut found);
                prop_assert_eq!(&found, &expected, "{} {}", &tree, point);
                let bounds = Aabb::around([point, corner * scale, point + Vec3::splat(size * scale)]);
                brute_force::triangles_in_box(&mesh, &bounds, &mut expected);
                triangles_in_box(&trees, &bounds, &mut found);
                prop_assert_eq!(&found, &expected, "{} {:?}", &tree, bounds);
            }
        }
    }
}
