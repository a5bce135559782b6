//! The serialized forms of public data: feature `serde`.
//!
//! Some formats, JSON above all, have no infinity and no NaN, which ranges of rays and empty boxes hold. In formats for people
//! to read, [`Real`] writes these values as text.

use std::fmt;

use serde::de::{Deserializer, Error, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

use crate::{Aabb, Culling, Mesh, MeshError, Ray, RayPacket8};

/// Any f32: a number, or `"inf"`, `"-inf"` and `"NaN"` in formats for people to read.
#[derive(Clone, Copy)]
struct Real(f32);

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() || !serializer.is_human_readable() {
            serializer.serialize_f32(self.0)
        } else {
            serializer.collect_str(&self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reals;

        impl Visitor<'_> for Reals {
            type Value = Real;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, \"inf\", \"-inf\" or \"NaN\"")
            }

            fn visit_f32<E: Error>(self, number: f32) -> Result<Real, E> {
                Ok(Real(number))
            }

            #[allow(
                clippy::cast_possible_truncation,
                reason = "rounds to the nearest f32; an f32 that was written comes back exactly"
            )]
            fn visit_f64<E: Error>(self, number: f64) -> Result<Real, E> {
                Ok(Real(number as f32))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Real, E> {
                Ok(Real(number as f32))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Real, E> {
                Ok(Real(number as f32))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Real, E> {
                match text {
                    "inf" => Ok(Real(f32::INFINITY)),
                    "-inf" => Ok(Real(f32::NEG_INFINITY)),
                    "NaN" => Ok(Real(f32::NAN)),
                    _ => Err(E::invalid_value(serde::de::Unexpected::Str(text), &self)),
                }
            }
        }

        if deserializer.is_human_readable() {
            deserializer.deserialize_any(Reals)
        } else {
            f32::deserialize(deserializer).map(Self)
        }
    }
}

fn reals<const N: usize>(numbers: impl Into<[f32; N]>) -> [Real; N] {
    numbers.into().map(Real)
}

fn numbers<const N: usize>(reals: [Real; N]) -> [f32; N] {
    reals.map(|real| real.0)
}

/// Implements both traits for a type by the conversion to and from its form.
macro_rules! by_form {
    ($type:ty, $form:ty) => {
        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                <$form>::from(self).serialize(serializer)
            }
        }

        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                <$form>::deserialize(deserializer).map(Self::from)
            }
        }
    };
}

#[derive(Serialize, Deserialize)]
#[serde(rename = "Aabb")]
struct AabbForm {
    min: [Real; 3],
    max: [Real; 3],
}

impl From<&Aabb> for AabbForm {
    fn from(bounds: &Aabb) -> Self {
        Self {
            min: reals(bounds.min),
            max: reals(bounds.max),
        }
    }
}

impl From<AabbForm> for Aabb {
    fn from(form: AabbForm) -> Self {
        Self {
            min: numbers(form.min).into(),
            max: numbers(form.max).into(),
        }
    }
}

by_form!(Aabb, AabbForm);

#[derive(Serialize, Deserialize)]
#[serde(rename = "Ray")]
struct RayForm {
    origin: [Real; 3],
    direction: [Real; 3],
    t_min: Real,
    t_max: Real,
    mask: u32,
    /// 1 for the back, 2 for the front, 3 for both.
    #[serde(default)]
    culling: u32,
}

impl From<&Ray> for RayForm {
    fn from(ray: &Ray) -> Self {
        Self {
            origin: reals(ray.origin),
            direction: reals(ray.direction),
            t_min: Real(ray.t_min),
            t_max: Real(ray.t_max),
            mask: ray.mask,
            culling: ray.culling.bits(),
        }
    }
}

impl From<RayForm> for Ray {
    fn from(form: RayForm) -> Self {
        Self {
            origin: numbers(form.origin).into(),
            direction: numbers(form.direction).into(),
            t_min: form.t_min.0,
            t_max: form.t_max.0,
            mask: form.mask,
            culling: Culling::of_bits(form.culling),
        }
    }
}

by_form!(Ray, RayForm);

/// Eight rays, lane by lane.
#[derive(Serialize, Deserialize)]
#[serde(rename = "RayPacket8", transparent)]
struct PacketForm([RayForm; 8]);

impl From<&RayPacket8> for PacketForm {
    fn from(packet: &RayPacket8) -> Self {
        Self(packet.rays().map(|ray| RayForm::from(&ray)))
    }
}

impl From<PacketForm> for RayPacket8 {
    fn from(form: PacketForm) -> Self {
        Self::new(&form.0.map(Ray::from))
    }
}

by_form!(RayPacket8, PacketForm);

/// A mesh before [`Mesh::new`] has checked it.
#[derive(Deserialize)]
#[serde(rename = "Mesh")]
struct MeshForm {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl TryFrom<MeshForm> for Mesh {
    type Error = MeshError;

    fn try_from(form: MeshForm) -> Result<Self, MeshError> {
        Self::new(form.positions, form.triangles)
    }
}

impl<'de> Deserialize<'de> for Mesh {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let form = MeshForm::deserialize(deserializer)?;
        Self::try_from(form).map_err(D::Error::custom)
    }
}

impl Serialize for Mesh {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        #[serde(rename = "Mesh")]
        struct Borrowed<'a> {
            positions: &'a [[f32; 3]],
            triangles: &'a [[u32; 3]],
        }
        Borrowed {
            positions: self.positions(),
            triangles: self.triangles(),
        }
        .serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use serde::de::DeserializeOwned;

    use super::*;
    use crate::{Axis, CostModel, Hit, Layout, LayoutBytes, Node, Pair, Slot, Tree, TreeStats};

    #[track_caller]
    fn round_trip<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) -> String {
        let text = serde_json::to_string(value).expect("serializable");
        let back: T = serde_json::from_str(&text).expect("just written");
        assert_eq!(back, *value, "{text}");
        text
    }

    fn mesh() -> Mesh {
        let positions = vec![[0.1, 0.2, 0.3], [1.0, 0.0, 1e-30], [0.0, 1.0, 3e38]];
        Mesh::new(positions, vec![[0, 1, 2]]).expect("valid")
    }

    #[test]
    fn what_is_written_is_read_back() {
        let ray = Ray::new([0.1, -0.0, 3e-39], [0.0, 0.3, -1.0]);
        let text = round_trip(&ray);
        assert!(text.contains(r#""t_max":"inf""#), "{text}");
        round_trip(&ray.with_range(f32::NEG_INFINITY, 0.5).with_mask(6));
        round_trip(&RayPacket8::new(&[ray; 3]));
        round_trip(&Hit {
            t: 0.1,
            u: 0.25,
            v: 1.0 / 3.0,
            triangle: 7,
        });
        round_trip(&Aabb::EMPTY);
        round_trip(&mesh().bounds());
        round_trip(&CostModel::PACKED);
        round_trip(&Axis::Y);
        round_trip(&Layout::Binary);
        round_trip(&LayoutBytes {
            nodes: 256,
            blocks: 320,
        });
        let text = round_trip(&mesh());
        assert!(!text.contains("bounds"), "computed again: {text}");
    }

    #[test]
    fn statistics_are_read_back() {
        let leaf = Node::leaf(0, 1).expect("small");
        let pairs = vec![Pair([leaf, Node::EMPTY_LEAF])];
        let bounds = mesh().bounds();
        let tree = Tree::from_parts(pairs, vec![Slot(0)], bounds, 1, CostModel::CLASSIC);
        let stats: TreeStats = tree.expect("valid").stats();
        round_trip(&stats);
        round_trip(&stats.with_zero_area(0));
    }

    #[test]
    fn rays_that_are_no_numbers_are_read_back() {
        let ray = Ray::new([f32::NAN; 3], [1.0; 3]);
        let text = serde_json::to_string(&ray).expect("serializable");
        let back: Ray = serde_json::from_str(&text).expect("just written");
        assert!(back.origin.is_nan() && !back.can_hit(), "{text}");
    }

    #[test]
    fn meshes_are_checked() {
        let text = r#"{ "positions": [[0, 0, 0]], "triangles": [[0, 0, 1]] }"#;
        let error = serde_json::from_str::<Mesh>(text).expect_err("no vertex 1");
        assert!(
            error.to_string().starts_with("triangle 0, corner 2"),
            "{error}"
        );
        let text = r#"{ "min": [0, 0, "zero"], "max": [1, 1, 1] }"#;
        let error = serde_json::from_str::<Aabb>(text).expect_err("no number");
        assert!(error.to_string().contains("\"inf\""), "{error}");
    }
}
