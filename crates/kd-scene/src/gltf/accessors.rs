//! The numbers that a glTF file refers to.
//!
//! The crate that reads the rest has readers for them too, which rely on counts, offsets and kinds fitting together. Files need
//! not keep to that.

use gltf::json::accessor::{ComponentType, GenericComponentType};
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
        if accessor.sparse.is_some() {
            return Err("it is sparse, which is not read");
        }
        let count = usize::try_from(accessor.count.0).map_err(|_| "it is too long")?;
        let view = accessor.buffer_view.ok_or("it has no bytes")?;
        let view = self
            .root
            .buffer_views
            .get(view.value())
            .ok_or("its view is not there")?;
        let bytes = self.buffers.of_view(view);
        let bytes = bytes.ok_or("its view is not within its buffer")?;
        let size = component.size();
        let stride = view.byte_stride.map_or(N * size, |stride| stride.0);
        let start = accessor.byte_offset.map_or(0, |offset| offset.0);
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
        let are_parts = are_parts || accessor.normalized;
        let value = |i: usize| {
            std::array::from_fn(|k| {
                let at = start + i * stride + k * size;
                number(&bytes[at..at + size], component, are_parts)
            })
        };
        Ok((0..count).map(value).collect())
    }
}

fn number(bytes: &[u8], component: ComponentType, is_part: bool) -> f64 {
    let part = |number: f64, greatest: f64| {
        if is_part {
            (number / greatest).max(-1.0)
        } else {
            number
        }
    };
    match (component, bytes) {
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
