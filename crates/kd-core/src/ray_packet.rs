//! A packet of eight rays, one per lane.

use crate::{Culling, Ray};
use glam::Vec3;

/// Eight rays as a structure of arrays: each field of [`Ray`] has eight lanes, one per ray.
///
/// It suits programs that make their rays eight at a time. The rays may be arbitrary. Coherent rays, such as those of
/// neighboring pixels, share the work of a traversal.
///
/// ```
/// use kd_core::{Ray, RayPacket8};
///
/// // Eight pixels in a row.
/// let mut packet = RayPacket8::default();
/// packet.direction[0] = [-3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5];
/// packet.direction[2] = [20.0; 8];
/// assert_eq!(packet.ray(2), Ray::new([0.0; 3], [-1.5, 0.0, 20.0]));
/// assert_eq!(packet, RayPacket8::new(&packet.rays()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct RayPacket8 {
    /// [`Ray::origin`], indexed by axis, then by lane.
    pub origin: [[f32; 8]; 3],
    /// [`Ray::direction`], indexed by axis, then by lane.
    pub direction: [[f32; 8]; 3],
    /// [`Ray::t_min`] of each lane.
    pub t_min: [f32; 8],
    /// [`Ray::t_max`] of each lane.
    pub t_max: [f32; 8],
    /// [`Ray::mask`] of each lane; 0 marks a lane without a ray.
    pub mask: [u32; 8],
    /// [`Ray::culling`] of each lane.
    pub culling: [Culling; 8],
}

/// Eight rays with origin 0, direction 0, `t` in [0, ∞), a mask of all bits and no culling. The caller fills in the directions.
impl Default for RayPacket8 {
    fn default() -> Self {
        Self::new(&[Ray::new(Vec3::ZERO, Vec3::ZERO); 8])
    }
}

impl RayPacket8 {
    /// A packet of up to eight rays, in the first lanes. The remaining lanes have no ray and hit nothing.
    ///
    /// # Panics
    ///
    /// If `rays` has more than eight elements.
    pub fn new(rays: &[Ray]) -> Self {
        assert!(
            rays.len() <= 8,
            "{} rays do not fit a packet of 8",
            rays.len()
        );
        let mut packet = Self {
            origin: [[0.0; 8]; 3],
            direction: [[0.0; 8]; 3],
            t_min: [0.0; 8],
            t_max: [0.0; 8],
            mask: [0; 8],
            culling: [Culling::NONE; 8],
        };
        for (lane, ray) in rays.iter().enumerate() {
            packet.set(lane, ray);
        }
        packet
    }

    /// The ray of a lane, 0 to 7.
    ///
    /// # Panics
    ///
    /// If `lane` is 8 or more.
    #[inline]
    pub fn ray(&self, lane: usize) -> Ray {
        Ray {
            origin: Vec3::from_array(self.origin.each_ref().map(|row| row[lane])),
            direction: Vec3::from_array(self.direction.each_ref().map(|row| row[lane])),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
            mask: self.mask[lane],
            culling: self.culling[lane],
        }
    }

    /// Sets the ray of a lane, 0 to 7.
    ///
    /// # Panics
    ///
    /// If `lane` is 8 or more.
    #[inline]
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
        self.t_min[lane] = ray.t_min;
        self.t_max[lane] = ray.t_max;
        self.mask[lane] = ray.mask;
        self.culling[lane] = ray.culling;
    }

    /// All eight rays, in the order of their lanes.
    pub fn rays(&self) -> [Ray; 8] {
        std::array::from_fn(|lane| self.ray(lane))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_lane_holds_one_ray() {
        let ray = |i: u8| {
            let x = f32::from(i);
            Ray::new([x, x + 0.1, x + 0.2], [1.0 - x, -x, 0.5 * x])
                .with_range(-x, x)
                .with_mask(i.into())
                .with_culling([Culling::NONE, Culling::BACK, Culling::FRONT][usize::from(i % 3)])
        };
        let rays: Vec<Ray> = (1..=8).map(ray).collect();
        let packet = RayPacket8::new(&rays);
        assert_eq!(packet.rays().as_slice(), rays, "lane by lane");
        let three = RayPacket8::new(&rays[..3]);
        assert_eq!(three.ray(2), rays[2], "the last ray");
        assert!(!three.ray(3).can_hit(), "a lane without a ray");
        assert!(!RayPacket8::new(&[]).ray(0).can_hit(), "an empty packet");
    }

    #[test]
    #[should_panic(expected = "9 rays")]
    fn nine_rays_are_refused() {
        RayPacket8::new(&[Ray::new(Vec3::ZERO, Vec3::X); 9]);
    }
}
