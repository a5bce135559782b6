//! What the alpha of a surface means.

/// What the alpha of a surface means (glTF 2.0, §3.9.4).
///
/// The alpha of a point is the product of that of its [material](crate::Material::alpha), of the texture, and of the
/// [vertices](crate::Surface::alphas).
///
/// ```
/// use kd_scene::AlphaMode;
///
/// assert_eq!(AlphaMode::Opaque.opacity(0.25), 1.0);
/// assert_eq!(AlphaMode::Mask { cutoff: 0.5 }.opacity(0.25), 0.0);
/// assert_eq!(AlphaMode::Blend.opacity(0.25), 0.25);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface has no holes.
    #[default]
    Opaque,
    /// The surface is opaque where alpha is at least the cutoff, and a hole elsewhere.
    Mask {
        /// The least alpha of an opaque point; above 1, there is none.
        cutoff: f32,
    },
    /// The surface covers a share `alpha` of what is behind it.
    Blend,
}

impl AlphaMode {
    /// The share of what is behind a point that the surface covers there, from 0 to 1. A NaN is a hole.
    #[inline]
    pub fn opacity(self, alpha: f32) -> f32 {
        match self {
            Self::Opaque => 1.0,
            Self::Mask { cutoff } if alpha >= cutoff => 1.0,
            Self::Blend if alpha > 0.0 => alpha.min(1.0),
            Self::Mask { .. } | Self::Blend => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacity_is_a_share_for_every_alpha() {
        let mask = |cutoff| AlphaMode::Mask { cutoff };
        for (mode, alpha, expected) in [
            (AlphaMode::Opaque, 0.0, 1.0),
            (AlphaMode::Opaque, f32::NAN, 1.0),
            (mask(0.5), 0.5, 1.0),
            (mask(0.5), 0.499, 0.0),
            (mask(0.0), 0.0, 1.0),
            (mask(1.5), 1.0, 0.0),
            (mask(0.5), f32::NAN, 0.0),
            (AlphaMode::Blend, 0.75, 0.75),
            (AlphaMode::Blend, -1.0, 0.0),
            (AlphaMode::Blend, f32::INFINITY, 1.0),
            (AlphaMode::Blend, f32::NAN, 0.0),
        ] {
            assert_eq!(mode.opacity(alpha), expected, "{mode:?} {alpha}");
        }
    }
}
