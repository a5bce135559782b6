//! Where a transform moves a point: the one rounding of transformed meshes and of instances.

use glam::Affine3A;

/// The point after the transform. Each coordinate is ((x p₀ + y p₁) + z p₂) + translation, where every operation rounds to f32, so that
/// code that transforms points in lanes gets the same bits.
///
/// ```
/// use glam::Affine3A;
/// use kd_core::transformed_point;
///
/// let by = Affine3A::from_translation([1.0, 0.0, -1.0].into());
/// assert_eq!(transformed_point(&by, [0.5, 0.25, 0.0]), [1.5, 0.25, -1.0]);
/// ```
#[inline]
pub fn transformed_point(by: &Affine3A, [p, q, r]: [f32; 3]) -> [f32; 3] {
    let [x, y, z] =
        [by.matrix3.x_axis, by.matrix3.y_axis, by.matrix3.z_axis].map(|axis| axis.to_array());
    let translation = by.translation.to_array();
    std::array::from_fn(|i| ((x[i] * p + y[i] * q) + z[i] * r) + translation[i])
}

#[cfg(test)]
mod tests {
    use glam::{Mat3, Vec3, Vec3A};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Transforms of glam round alike where it has no fused multiply-add.
        #[test]
        #[cfg(target_arch = "x86_64")]
        fn it_rounds_as_glam_does(
            columns in prop::array::uniform3(prop::array::uniform3(-9.0_f32..9.0)),
            translation in prop::array::uniform3(-9.0_f32..9.0),
            point in prop::array::uniform3(-9.0_f32..9.0),
        ) {
            let matrix = Mat3::from_cols_array_2d(&columns);
            let by = Affine3A::from_mat3_translation(matrix, Vec3::from(translation));
            let expected = by.transform_point3a(Vec3A::from(point)).to_array();
            prop_assert_eq!(transformed_point(&by, point), expected);
        }
    }
}
