//! Reads the numbers of accessors, and checks all counts, offsets and types, because a file may be invalid.

use super::buffers::Buffers;
use super::json::{Accessor, Document, Sparse, SparseArray, Whole};
use crate::LoadError;

/// The values of an accessor: `width` numbers each, one value after the other.
#[derive(Debug, PartialEq)]
pub(super) struct Numbers<T> {
    pub(super) width: usize,
    pub(super) numbers: Vec<T>,
}

impl<T: Copy> Numbers<T> {
    pub(super) fn count(&self) -> usize {
        self.numbers.len() / self.width
    }

    /// The values as arrays; `None` if they have another width.
    pub(super) fn arrays<const N: usize>(self) -> Option<Vec<[T; N]>> {
        (self.width == N).then(|| self.numbers.as_chunks::<N>().0.to_vec())
    }
}

/// A type that the numbers of accessors are converted to.
pub(super) trait Number: Copy + Default {
    /// Converts an integer. `largest` is the largest integer of a normalized type, `None` for others.
    fn of_integer(integer: i64, largest: Option<f64>) -> Self;
    /// Converts a float.
    fn of_float(float: f32) -> Self;
}

impl Number for f32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "integers have at most 32 bits; rounding is intended"
    )]
    fn of_integer(integer: i64, largest: Option<f64>) -> Self {
        match largest {
            Some(largest) => (integer as f64 / largest).max(-1.0) as Self,
            None => integer as Self,
        }
    }

    fn of_float(float: f32) -> Self {
        float
    }
}

impl Number for u32 {
    fn of_integer(integer: i64, _: Option<f64>) -> Self {
        Self::try_from(integer).unwrap_or(Self::MAX)
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "other values saturate and are refused as out of range, or become 0"
    )]
    fn of_float(float: f32) -> Self {
        float as Self
    }
}

/// The type of the components in a buffer.
#[derive(Clone, Copy, Debug)]
struct Component {
    kind: usize,
    /// Whether integers are divided by the largest integer of their type.
    is_normalized: bool,
}

impl Component {
    fn new(kind: Whole, is_normalized: bool) -> Result<Self, String> {
        match kind.0 {
            5120..=5123 | 5125 | 5126 => Ok(Self {
                kind: kind.0,
                is_normalized,
            }),
            other => Err(format!("has the unknown componentType {other}")),
        }
    }

    fn size(self) -> usize {
        match self.kind {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        }
    }

    /// Converts the components at `places` of `bytes`, which has all of them.
    fn read<T: Number>(self, bytes: &[u8], places: impl Iterator<Item = usize>) -> Vec<T> {
        fn array<const N: usize>(bytes: &[u8], place: usize) -> [u8; N] {
            *bytes[place..]
                .first_chunk()
                .expect("the caller has checked the length")
        }
        let largest = |largest: u16| self.is_normalized.then_some(f64::from(largest));
        match self.kind {
            5120 => {
                let of =
                    |at| T::of_integer(i8::from_le_bytes(array(bytes, at)).into(), largest(127));
                places.map(of).collect()
            }
            5121 => places
                .map(|at| T::of_integer(bytes[at].into(), largest(255)))
                .collect(),
            5122 => {
                let number = |at| i16::from_le_bytes(array(bytes, at)).into();
                places
                    .map(|at| T::of_integer(number(at), largest(32767)))
                    .collect()
            }
            5123 => {
                let number = |at| u16::from_le_bytes(array(bytes, at)).into();
                places
                    .map(|at| T::of_integer(number(at), largest(65535)))
                    .collect()
            }
            5125 => {
                let number = |at| u32::from_le_bytes(array(bytes, at)).into();
                places.map(|at| T::of_integer(number(at), None)).collect()
            }
            _ => places
                .map(|at| T::of_float(f32::from_le_bytes(array(bytes, at))))
                .collect(),
        }
    }
}

const ACCESSORS: &str = "/accessors";

/// The values of an accessor. Integers of a normalized accessor, or if `is_normalized`, are divided by the largest integer of their
/// type.
pub(super) fn numbers<T: Number>(
    document: &Document,
    buffers: &mut Buffers<'_>,
    index: Whole,
    is_normalized: bool,
) -> Result<Numbers<T>, LoadError> {
    let accessor: Accessor = document.get(ACCESSORS, index)?;
    let bad = |problem: String| document.bad_value(&format!("{ACCESSORS}/{}", index.0), problem);
    let is_normalized = is_normalized || accessor.normalized;
    let component = Component::new(accessor.component_type, is_normalized).map_err(bad)?;
    let width = match accessor.r#type.as_str() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        other => {
            return Err(bad(format!(
                "has the type `{other}`, which is not used here"
            )));
        }
    };
    let count = accessor.count.0;
    let mut numbers: Vec<T> = match accessor.buffer_view {
        Some(view) => {
            let (bytes, stride) = buffers.view(document, view)?;
            let layout = Layout {
                width,
                stride,
                component,
            };
            layout
                .read(bytes, accessor.byte_offset.0, count)
                .map_err(bad)?
        }
        None => {
            // Zeros take no bytes, so a short file could declare any number of them: few are free, and more where the buffers that
            // were read have as many bytes.
            const FREE: usize = 1 << 16;
            if let Some(sparse) = &accessor.sparse {
                buffers.view(document, sparse.values.buffer_view)?;
            }
            if count > FREE.max(buffers.bytes()) {
                return Err(bad(format!("has no bufferView for its {count} values")));
            }
            vec![T::default(); width * count]
        }
    };
    if let Some(sparse) = &accessor.sparse {
        replace(
            &mut numbers,
            document,
            buffers,
            sparse,
            width,
            component,
            &bad,
        )?;
    }
    Ok(Numbers { width, numbers })
}

/// How the values of an accessor lie in a buffer view.
#[derive(Clone, Copy)]
struct Layout {
    width: usize,
    /// The distance of values in bytes; 0 if they follow each other.
    stride: usize,
    component: Component,
}

impl Layout {
    /// `count` values of a buffer view, from byte `start` on.
    fn read<T: Number>(self, bytes: &[u8], start: usize, count: usize) -> Result<Vec<T>, String> {
        let size = self.component.size();
        let length = self.width * size;
        let stride = if self.stride == 0 {
            length
        } else {
            self.stride
        };
        if stride < length {
            return Err(format!(
                "has values of {length} bytes, but its bufferView a byteStride of {stride}"
            ));
        }
        let needed = match count {
            0 => 0,
            _ => stride
                .saturating_mul(count - 1)
                .saturating_add(length)
                .saturating_add(start),
        };
        if needed > bytes.len() {
            return Err(format!(
                "needs {needed} bytes, its bufferView has {}",
                bytes.len()
            ));
        }
        if stride == length {
            // One run of components, without a step between values.
            let places = (start..).step_by(size).take(count * self.width);
            return Ok(self.component.read(bytes, places));
        }
        let places =
            (0..count).flat_map(|i| (0..self.width).map(move |k| start + i * stride + k * size));
        Ok(self.component.read(bytes, places))
    }
}

/// Replaces the values of a sparse accessor (glTF 2.0, §3.6.2.3).
fn replace<T: Number>(
    numbers: &mut [T],
    document: &Document,
    buffers: &mut Buffers<'_>,
    sparse: &Sparse,
    width: usize,
    component: Component,
    bad: &impl Fn(String) -> LoadError,
) -> Result<(), LoadError> {
    let count = sparse.count.0;
    let mut read = |array: &SparseArray, layout: Layout| -> Result<Vec<T>, LoadError> {
        let (bytes, _) = buffers.view(document, array.buffer_view)?;
        layout.read(bytes, array.byte_offset.0, count).map_err(bad)
    };
    let replacements = read(
        &sparse.values,
        Layout {
            width,
            stride: 0,
            component,
        },
    )?;
    let component = Component::new(sparse.indices.component_type, false).map_err(bad)?;
    let (bytes, _) = buffers.view(document, sparse.indices.buffer_view)?;
    let layout = Layout {
        width: 1,
        stride: 0,
        component,
    };
    let indices: Vec<u32> = layout
        .read(bytes, sparse.indices.byte_offset.0, count)
        .map_err(bad)?;
    for (index, replacement) in indices.into_iter().zip(replacements.chunks_exact(width)) {
        let value = numbers.chunks_exact_mut(width).nth(index as usize);
        let value =
            value.ok_or_else(|| bad(format!("has the sparse index {index} out of range")))?;
        value.copy_from_slice(replacement);
    }
    Ok(())
}
