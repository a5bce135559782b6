//! Pinhole cameras, and a default camera for a bounding box.

use glam::{DVec3, Vec3};
use kd_core::Aabb;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position, in scene units.
    pub eye: Vec3,
    /// The point at the center of the image. Should differ from `eye`; see [`view`](Self::view).
    pub target: Vec3,
    /// Approximate up direction, of any length and at any angle to the view.
    pub up: Vec3,
    /// Vertical field of view in degrees, between 0 and 180, both excluded.
    pub fov_degrees: f32,
}

/// The image plane of a [`Camera`], made by [`Camera::view`]: it gives the directions of primary rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Origin of every ray, in scene units.
    pub eye: Vec3,
    /// Unit direction to the center of the image.
    pub forward: Vec3,
    /// Vector from the center of the image to its right edge, on the plane one unit in front of the eye.
    pub right: Vec3,
    /// Vector from the center of the image to its lower edge, on the plane one unit in front of the eye.
    pub down: Vec3,
}

/// Vertical field of view of a default camera, in degrees.
const FOV_DEGREES: f32 = 45.0;
/// Factor on the distance at which the box touches the edge of the image.
const MARGIN: f64 = 1.05;

impl Camera {
    /// A camera outside of `bounds` that views the box obliquely from above, so that it nearly fills a square image. The field
    /// of view is 45 degrees.
    ///
    /// An empty box, or one that is not finite, counts as the point at the origin. The distance to a point is one unit, or a
    /// thousandth of its largest coordinate if that is more. An `up` of length zero counts as +y. For boxes wider than about
    /// 1e37, the camera does not fit in `f32`.
    pub fn looking_at_whole(bounds: Aabb, up: Vec3) -> Self {
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let finite = low.is_finite() && high.is_finite() && low.cmple(high).all();
        let (low, high) = if finite {
            (low, high)
        } else {
            (DVec3::ZERO, DVec3::ZERO)
        };
        let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);

        let up = up_or_y(up);
        let side = any_perpendicular(up);
        // Obliquely from the side and from above.
        let towards_eye = (side + 0.5 * up.cross(side) + 0.5 * up).normalize();
        let right = up.cross(towards_eye).normalize();
        let above = towards_eye.cross(right);

        let slope = half_slope(FOV_DEGREES);
        let mut distance = 0.0_f64;
        for corner in 0..8 {
            let sign = |axis: u32| if corner & 1 << axis == 0 { -1.0 } else { 1.0 };
            let corner = half * DVec3::new(sign(0), sign(1), sign(2));
            let across = corner.dot(right).abs().max(corner.dot(above).abs());
            distance = distance.max(across / slope + corner.dot(towards_eye));
        }
        // At a smaller distance, the eye and the target could round to the same point.
        let floor = (center.abs().max_element() * 1e-3).max(f64::from(f32::MIN_POSITIVE));
        let distance = match half == DVec3::ZERO {
            true => floor.max(1.0),
            false => (distance * MARGIN).max(floor * 1e-2),
        };
        Self {
            eye: (center + distance * towards_eye).as_vec3(),
            target: center.as_vec3(),
            up: up.as_vec3(),
            fov_degrees: FOV_DEGREES,
        }
    }

    /// The image plane of an image whose width is `aspect` times its height.
    ///
    /// Trigonometric functions come from libm, so a camera gives the same rays on every platform. An `up` parallel to the view,
    /// or of length zero, is replaced by a direction perpendicular to the view. If `eye` and `target` coincide, the view is
    /// along -z.
    pub fn view(&self, aspect: f32) -> View {
        let forward = (self.target.as_dvec3() - self.eye.as_dvec3()).try_normalize();
        let forward = forward.unwrap_or(DVec3::NEG_Z);
        let right = forward.cross(self.up.as_dvec3()).try_normalize();
        let right = right.unwrap_or_else(|| any_perpendicular(forward));
        let down = forward.cross(right);
        let slope = half_slope(self.fov_degrees);
        View {
            eye: self.eye,
            forward: forward.as_vec3(),
            right: (slope * f64::from(aspect) * right).as_vec3(),
            down: (slope * down).as_vec3(),
        }
    }

    /// Direction of the ray through the point `(x, y)` of a square image, each from 0 to 1; see [`View::direction`].
    pub fn ray_direction(&self, x: f32, y: f32) -> Vec3 {
        self.view(1.0).direction(x, y)
    }
}

impl View {
    /// Direction of the ray through a point of the image: `x` from 0 at the left edge to 1 at the right edge, `y` from 0 at the
    /// upper edge to 1 at the lower edge. Its length is 1 at the center and more elsewhere.
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        self.forward + (2.0 * x - 1.0) * self.right + (2.0 * y - 1.0) * self.down
    }

    /// Direction of the ray through the center of the pixel in `column` and `row`, both from 0 at the upper left, of an image
    /// of `width` × `height` pixels.
    pub fn through_pixel(&self, column: u32, row: u32, width: u32, height: u32) -> Vec3 {
        // Pixel counts above 2^24 round, by less than half a pixel.
        #[expect(clippy::cast_precision_loss, reason = "see above")]
        let center = |index: u32, count: u32| (index as f32 + 0.5) / count as f32;
        self.direction(center(column, width), center(row, height))
    }
}

/// A default light position: above the eye of [`looking_at_whole`](Camera::looking_at_whole), at a distance of the diagonal of
/// `bounds`, or one unit if the box has no finite diagonal.
pub fn light_above(bounds: Aabb, up: Vec3) -> Vec3 {
    let camera = Camera::looking_at_whole(bounds, up);
    // In f64: the squares of large coordinates do not fit in f32.
    let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
    let reach = if diagonal.is_finite() && diagonal > 0.0 {
        diagonal
    } else {
        1.0
    };
    (camera.eye.as_dvec3() + camera.up.as_dvec3() * reach).as_vec3()
}

fn half_slope(fov_degrees: f32) -> f64 {
    libm::tan(f64::from(fov_degrees).to_radians() * 0.5)
}

pub(crate) fn up_or_y(up: Vec3) -> DVec3 {
    up.as_dvec3().try_normalize().unwrap_or(DVec3::Y)
}

/// A unit vector perpendicular to the unit vector `to`.
pub(crate) fn any_perpendicular(to: DVec3) -> DVec3 {
    let size = to.abs();
    let least = match size.min_element() {
        least if size.x == least => DVec3::X,
        least if size.y == least => DVec3::Y,
        _ => DVec3::Z,
    };
    least.cross(to).normalize()
}
