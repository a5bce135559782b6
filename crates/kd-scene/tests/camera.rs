//! Cameras for a bounding box, and their ray directions.

use glam::Vec3;
use kd_core::Aabb;
use kd_scene::{Camera, light_above};

fn boxed(min: [f32; 3], max: [f32; 3]) -> Aabb {
    Aabb {
        min: min.into(),
        max: max.into(),
    }
}

fn corners(bounds: Aabb) -> [Vec3; 8] {
    std::array::from_fn(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { bounds.min } else { bounds.max }[axis];
        Vec3::new(pick(0), pick(1), pick(2))
    })
}

#[test]
fn the_box_nearly_fills_the_image() {
    let rows = [
        boxed([-1.0; 3], [1.0; 3]),
        boxed([0.0; 3], [100.0, 1.0, 1.0]),
        boxed([-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]),
        boxed([0.0; 3], [0.0, 0.0, 3.0]),
        boxed([1e6; 3], [1e6 + 64.0; 3]),
        boxed([-1e-6; 3], [1e-6; 3]),
        boxed([-1e36; 3], [1e36; 3]),
    ];
    for bounds in rows {
        for up in [
            Vec3::X,
            Vec3::Y,
            Vec3::Z,
            Vec3::new(1.0, -2.0, 3.0),
            Vec3::NEG_Y,
        ] {
            let camera = Camera::looking_at_whole(bounds, up);
            let view = camera.view(1.0);
            let mut widest = 0.0_f64;
            for corner in corners(bounds) {
                let offset = corner.as_dvec3() - camera.eye.as_dvec3();
                let depth = offset.dot(view.forward.as_dvec3());
                assert!(depth > 0.0, "{corner} is behind the eye: {camera:?}");
                for across in [view.right.as_dvec3(), view.down.as_dvec3()] {
                    widest =
                        widest.max((offset.dot(across) / across.length_squared() / depth).abs());
                }
            }
            assert!(
                (0.8..1.0).contains(&widest),
                "reaches {widest} of {bounds:?} from {camera:?}"
            );
            assert!(camera.eye.cmplt(bounds.min).any() || camera.eye.cmpgt(bounds.max).any());
            let above = light_above(bounds, up).as_dvec3() - camera.eye.as_dvec3();
            assert!(
                above.normalize().dot(up.as_dvec3().normalize()) > 0.99,
                "{above} is not up"
            );
        }
    }
}

#[test]
fn boxes_without_extent_give_a_camera() {
    let nan = boxed([f32::NAN; 3], [1.0; 3]);
    for bounds in [
        Aabb::EMPTY,
        nan,
        boxed([3.0; 3], [3.0; 3]),
        boxed([-1e20; 3], [-1e20; 3]),
    ] {
        for up in [
            Vec3::Y,
            Vec3::ZERO,
            Vec3::splat(f32::NAN),
            Vec3::splat(f32::INFINITY),
        ] {
            let camera = Camera::looking_at_whole(bounds, up);
            assert!(
                camera.eye.is_finite() && camera.target.is_finite(),
                "{camera:?}"
            );
            assert!(camera.eye != camera.target, "{camera:?}");
            let view = camera.view(1.5);
            assert!((view.forward.length() - 1.0).abs() < 1e-6, "{view:?}");
            assert!(light_above(bounds, up).is_finite(), "{bounds:?}");
        }
    }
}

#[test]
fn x_goes_right_and_y_goes_down() {
    let camera = Camera {
        eye: Vec3::ZERO,
        target: Vec3::NEG_Z,
        up: Vec3::Y,
        fov_degrees: 90.0,
    };
    let near = |direction: Vec3, expected: [f32; 3]| {
        let expected = Vec3::from(expected);
        assert!(
            direction.abs_diff_eq(expected, 1e-6),
            "{direction} is not {expected}"
        );
    };
    near(camera.ray_direction(0.5, 0.5), [0.0, 0.0, -1.0]);
    near(camera.ray_direction(0.0, 0.0), [-1.0, 1.0, -1.0]);
    near(camera.ray_direction(1.0, 1.0), [1.0, -1.0, -1.0]);
    let wide = camera.view(2.0);
    near(wide.direction(1.0, 0.5), [2.0, 0.0, -1.0]);
    near(wide.through_pixel(0, 0, 4, 2), [-1.5, 0.5, -1.0]);
    near(wide.through_pixel(3, 1, 4, 2), [1.5, -0.5, -1.0]);
}

#[test]
fn degenerate_cameras_have_a_view() {
    let at = |target: Vec3, up: Vec3| Camera {
        eye: Vec3::ONE,
        target,
        up,
        fov_degrees: 45.0,
    };
    for camera in [
        at(Vec3::ONE, Vec3::Y),
        at(Vec3::ZERO, Vec3::ONE),
        at(Vec3::ZERO, Vec3::ZERO),
    ] {
        let view = camera.view(1.0);
        let axes = [view.forward, view.right, view.down];
        assert!(
            axes.iter()
                .all(|axis| axis.is_finite() && axis.length() > 0.1),
            "{view:?}"
        );
        assert!(view.right.dot(view.down).abs() < 1e-6, "{view:?}");
    }
}
