//! The numbers that a glTF file refers to.
//!
//! The crate that reads the rest has readers for them too, which rely on counts, offsets and kinds fitting together. Files need
//! not keep to that.

use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType};
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};

use super::buffers::Buffers;

/// All accessors of a file, and their bytes.
#[derive(Clone, Copy)]
pub(super) struct Accessors<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: &'a Buffers,
}

impl Accessors<'_> {
    /// Values of `N` numbers each. Integers that are normalised, or `are_parts`, are parts of their greatest.
    ///
    /// # Errors
    ///
    /// What is wrong with it, as a sentence without its beginning.
    pub(super) fn read<const N: usize>(
        &self,
        index: Index<Accessor>,
        are_parts: bool,
    ) -> Result<Vec<[f64; N]>, &'static str> {
        let accessor = self
            .root
            .accessors
            .get(index.value())
            .ok_or("it is not there")?;
        let (Checked::Valid(kind), Checked::Valid(GenericComponentType(component))) =
            (accessor.type_, accessor.component_type)
        else {
            return Err("its kind is not known");
        };
        if kind.multiplicity() != N {
            return Err("its values are of another kind");
        }
        let count = usize::try_from(accessor.count.0).map_err(|_| TOO_LONG)?;
        let kind = Kind {
            component,
            are_parts: are_parts || accessor.normalized,
        };
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let start = accessor.byte_offset.map_or(0, |offset| offset.0);
                self.values(view, start, count, kind)?
            }
            None if accessor.sparse.is_none() => return Err("it has no bytes"),
            // Zeros take no bytes in the file, so a short one can ask for any number of them.
            None if count > self.buffers.bytes() => return Err(TOO_LONG),
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = &accessor.sparse {
            self.replace(&mut values, sparse, kind)?;
        }
        Ok(values)
    }

    /// Values from somewhere in a view.
    fn values<const N: usize>(
        &self,
        view: Index<View>,
        start: u64,
        count: usize,
        kind: Kind,
    ) -> Result<Vec<[f64; N]>, &'static str> {
        let view = self.root.buffer_views.get(view.value());
        let view = view.ok_or("its view is not there")?;
        let bytes = self.buffers.of_view(view);
        let bytes = bytes.ok_or("its view is not within its buffer")?;
        let size = kind.component.size();
        let stride = view.byte_stride.map_or(N * size, |stride| stride.0);
        let start = usize::try_from(start).map_err(|_| "it begins too far on")?;
        let needed = match count {
            0 => 0,
            _ => stride
                .saturating_mul(count - 1)
                .saturating_add(N * size)
                .saturating_add(start),
        };
        if stride < N * size || needed > bytes.len() {
            return Err("it is not within its view");
        }
        let value = |i: usize| {
            std::array::from_fn(|k| {
                let at = start + i * stride + k * size;
                number(&bytes[at..at + size], kind)
            })
        };
        Ok((0..count).map(value).collect())
    }

    /// Puts other values in the place of some (glTF 2.0, §3.6.2.3).
    fn replace<const N: usize>(
        &self,
        values: &mut [[f64; N]],
        sparse: &Sparse,
        kind: Kind,
    ) -> Result<(), &'static str> {
        let count = usize::try_from(sparse.count.0).map_err(|_| TOO_LONG)?;
        let Checked::Valid(IndexComponentType(component)) = sparse.indices.component_type else {
            return Err("its kind is not known");
        };
        let whole = Kind {
            component,
            are_parts: false,
        };
        let Sparse {
            indices,
            values: others,
            ..
        } = sparse;
        let places = self.values(indices.buffer_view, indices.byte_offset.0, count, whole)?;
        let others = self.values(others.buffer_view, others.byte_offset.0, count, kind)?;
        for ([place], other) in places.into_iter().zip(others) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "it comes from at most 32 bits, without a sign"
            )]
            let value = values.get_mut(place as usize);
            *value.ok_or("it replaces a value that it has not")? = other;
        }
        Ok(())
    }
}

const TOO_LONG: &str = "it is too long";

/// What bytes mean.
#[derive(Clone, Copy)]
struct Kind {
    component: ComponentType,
    /// Integers are parts of their greatest.
    are_parts: bool,
}

fn number(bytes: &[u8], kind: Kind) -> f64 {
    let part = |number: f64, greatest: f64| {
        if kind.are_parts {
            (number / greatest).max(-1.0)
        } else {
            number
        }
    };
    match (kind.component, bytes) {
        (ComponentType::I8, [a]) => part(f64::from(i8::from_le_bytes([*a])), f64::from(i8::MAX)),
        (ComponentType::U8, [a]) => part(f64::from(*a), f64::from(u8::MAX)),
        (ComponentType::I16, [a, b]) => {
            part(f64::from(i16::from_le_bytes([*a, *b])), f64::from(i16::MAX))
        }
        (ComponentType::U16, [a, b]) => {
            part(f64::from(u16::from_le_bytes([*a, *b])), f64::from(u16::MAX))
        }
        (ComponentType::U32, [a, b, c, d]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        (ComponentType::F32, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => unreachable!("as many bytes as the component has"),
    }
}
