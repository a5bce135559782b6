//! Reads the numbers of accessors.
//!
//! The readers of the `gltf` crate rely on consistent counts, offsets and types. The readers here check
//! them, because a file may be invalid.

use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType};
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};

use super::buffers::Buffers;

/// The accessors of a file, and the buffers that they refer to.
#[derive(Clone, Copy)]
pub(super) struct Accessors<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: &'a Buffers,
}

impl Accessors<'_> {
    /// The values of an accessor, `N` numbers each. Integers of a normalized accessor, or if `is_normalized`, are divided by
    /// the largest integer of their type.
    ///
    /// # Errors
    ///
    /// The fault as a predicate, without the name of the accessor.
    pub(super) fn read<const N: usize>(
        &self,
        index: Index<Accessor>,
        is_normalized: bool,
    ) -> Result<Vec<[f64; N]>, &'static str> {
        let accessor = self
            .root
            .accessors
            .get(index.value())
            .ok_or("does not exist")?;
        let (Checked::Valid(format), Checked::Valid(GenericComponentType(component))) =
            (accessor.type_, accessor.component_type)
        else {
            return Err("has an unknown type");
        };
        if format.multiplicity() != N {
            return Err("has another number of components than its use needs");
        }
        let count = usize::try_from(accessor.count.0).map_err(|_| TOO_LONG)?;
        let format = NumberFormat {
            component,
            is_normalized: is_normalized || accessor.normalized,
        };
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let start = accessor.byte_offset.map_or(0, |offset| offset.0);
                self.values(view, start, count, format)?
            }
            None if accessor.sparse.is_none() => {
                return Err("has neither a buffer view nor sparse values");
            }
            // Implicit zeros take no bytes, so a short file could declare any number of them.
            None if count > self.buffers.bytes() => return Err(TOO_LONG),
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = &accessor.sparse {
            self.replace(&mut values, sparse, format)?;
        }
        Ok(values)
    }

    /// `count` values of a buffer view, from byte `start` on.
    fn values<const N: usize>(
        &self,
        view: Index<View>,
        start: u64,
        count: usize,
        format: NumberFormat,
    ) -> Result<Vec<[f64; N]>, &'static str> {
        let view = self.root.buffer_views.get(view.value());
        let view = view.ok_or("its buffer view does not exist")?;
        let bytes = self.buffers.of_view(view);
        let bytes = bytes.ok_or("its buffer view exceeds the buffer")?;
        let size = format.component.size();
        let stride = view.byte_stride.map_or(N * size, |stride| stride.0);
        let start = usize::try_from(start).map_err(|_| "has a byte offset that is too large")?;
        let needed = match count {
            0 => 0,
            _ => stride
                .saturating_mul(count - 1)
                .saturating_add(N * size)
                .saturating_add(start),
        };
        if stride < N * size || needed > bytes.len() {
            return Err("exceeds its buffer view");
        }
        let value = |i: usize| {
            std::array::from_fn(|k| {
                let at = start + i * stride + k * size;
                number(&bytes[at..at + size], format)
            })
        };
        Ok((0..count).map(value).collect())
    }

    /// Replaces the values of a sparse accessor (glTF 2.0, §3.6.2.3).
    fn replace<const N: usize>(
        &self,
        values: &mut [[f64; N]],
        sparse: &Sparse,
        format: NumberFormat,
    ) -> Result<(), &'static str> {
        let count = usize::try_from(sparse.count.0).map_err(|_| TOO_LONG)?;
        let Checked::Valid(IndexComponentType(component)) = sparse.indices.component_type else {
            return Err("has an unknown type");
        };
        let unscaled = NumberFormat {
            component,
            is_normalized: false,
        };
        let Sparse {
            indices,
            values: replacements,
            ..
        } = sparse;
        let indices_of_values =
            self.values(indices.buffer_view, indices.byte_offset.0, count, unscaled)?;
        let replacements = self.values(
            replacements.buffer_view,
            replacements.byte_offset.0,
            count,
            format,
        )?;
        for ([index], replacement) in indices_of_values.into_iter().zip(replacements) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an unsigned integer of at most 32 bits"
            )]
            let value = values.get_mut(index as usize);
            *value.ok_or("has a sparse index out of range")? = replacement;
        }
        Ok(())
    }
}

const TOO_LONG: &str = "has a count that is too large for the file";

/// The encoding of a number.
#[derive(Clone, Copy)]
struct NumberFormat {
    component: ComponentType,
    /// Whether integers are divided by the largest integer of their type.
    is_normalized: bool,
}

fn number(bytes: &[u8], format: NumberFormat) -> f64 {
    let scaled = |number: f64, largest: f64| {
        if format.is_normalized {
            (number / largest).max(-1.0)
        } else {
            number
        }
    };
    match (format.component, bytes) {
        (ComponentType::I8, [a]) => scaled(f64::from(i8::from_le_bytes([*a])), f64::from(i8::MAX)),
        (ComponentType::U8, [a]) => scaled(f64::from(*a), f64::from(u8::MAX)),
        (ComponentType::I16, [a, b]) => {
            scaled(f64::from(i16::from_le_bytes([*a, *b])), f64::from(i16::MAX))
        }
        (ComponentType::U16, [a, b]) => {
            scaled(f64::from(u16::from_le_bytes([*a, *b])), f64::from(u16::MAX))
        }
        (ComponentType::U32, [a, b, c, d]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        (ComponentType::F32, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => unreachable!("the slice has the size of the component"),
    }
}
