//! The elements of a binary PLY file.

use super::Row;
use super::header::{Element, Encoding, Kind, Scalar};
use crate::LoadError;
use crate::file_mesh::Corner;
use crate::source::Source;

/// Reads the binary elements of a kind, one after the other.
pub(super) struct BinaryRows<'e> {
    element: &'e Element,
    is_big_endian: bool,
    /// Where the values are that are used, and how long a vertex is, if that is the same in all vertices.
    fixed: Option<(Vec<Place>, usize)>,
    /// The type of indices, if a face is a list of 32-bit indices with a count of one byte, in little endian, and nothing else.
    plain_list: Option<Scalar>,
}

/// Where a value is in a vertex.
struct Place {
    /// Its number in a row.
    value: usize,
    offset: usize,
    scalar: Scalar,
}

/// What a row lacks.
enum Lack {
    /// The row has at least that many bytes.
    Bytes(usize),
    /// The row has a fault.
    Fault(&'static str),
}

impl<'e> BinaryRows<'e> {
    pub(super) fn new(element: &'e Element, encoding: Encoding) -> Self {
        let is_big_endian = encoding == Encoding::BigEndian;
        let plain_list = match element.properties.as_slice() {
            [only] if !is_big_endian => match only.kind {
                Kind::List {
                    count: Scalar::U8,
                    item,
                } if item.size() == 4 && item.is_integer() => Some(item),
                _ => None,
            },
            _ => None,
        };
        Self {
            element,
            is_big_endian,
            fixed: places_of(element),
            plain_list,
        }
    }

    /// Reads the next row, which is number `index`.
    #[inline]
    pub(super) fn next(
        &self,
        source: &mut Source<'_>,
        index: usize,
        row: &mut Row,
    ) -> Result<(), LoadError> {
        let mut needed = 1;
        loop {
            let bytes = source.at_least(needed)?;
            let is_short = bytes.len() < needed;
            match self.parse(bytes, row) {
                Ok(length) => {
                    source.take(length);
                    return Ok(());
                }
                Err(Lack::Bytes(more)) if !is_short => needed = more,
                Err(Lack::Bytes(_)) => {
                    return Err(LoadError::Truncated {
                        file: source.name.to_owned(),
                        element: self.element.name.clone(),
                        index,
                        count: self.element.count,
                    });
                }
                Err(Lack::Fault(problem)) => {
                    return Err(LoadError::BadElement {
                        file: source.name.to_owned(),
                        element: self.element.name.clone(),
                        index,
                        problem: problem.to_owned(),
                    });
                }
            }
        }
    }

    /// Reads a row at the start of `bytes`, and returns its length.
    #[inline]
    fn parse(&self, bytes: &[u8], row: &mut Row) -> Result<usize, Lack> {
        if let Some((places, size)) = &self.fixed {
            let bytes = bytes.get(..*size).ok_or(Lack::Bytes(*size))?;
            for place in places {
                row.values[place.value] = self.float(&bytes[place.offset..], place.scalar);
            }
            return Ok(*size);
        }
        if let Some(scalar) = self.plain_list
            && let [count, items @ ..] = bytes
        {
            let length = 4 * usize::from(*count);
            let items = items.get(..length).ok_or(Lack::Bytes(1 + length))?;
            row.corners.clear();
            let items = items.as_chunks::<4>().0.iter();
            if scalar == Scalar::U32 {
                let index = |item: &[u8; 4]| Corner::from_zero(u32::from_le_bytes(*item).into());
                row.corners.extend(items.map(index));
            } else {
                let index = |item: &[u8; 4]| Corner::from_zero(i32::from_le_bytes(*item).into());
                row.corners.extend(items.map(index));
            }
            return Ok(1 + length);
        }
        self.parse_any(bytes, row)
    }

    fn parse_any(&self, bytes: &[u8], row: &mut Row) -> Result<usize, Lack> {
        row.corners.clear();
        let mut at = 0;
        for property in &self.element.properties {
            let scalar = match property.kind {
                Kind::Scalar(scalar) | Kind::List { count: scalar, .. } => scalar,
            };
            let end = at + scalar.size();
            let number = bytes.get(at..end).ok_or(Lack::Bytes(end))?;
            at = end;
            let Kind::List { item, .. } = property.kind else {
                row.set(&property.name, || self.float(number, scalar));
                continue;
            };
            let count = usize::try_from(self.integer(number, scalar));
            let count = count.map_err(|_| Lack::Fault("a list has a negative count"))?;
            let end = at.saturating_add(count.saturating_mul(item.size()));
            let items = bytes.get(at..end).ok_or(Lack::Bytes(end))?;
            at = end;
            if super::is_corner_list(&property.name) {
                let items = items.chunks_exact(item.size());
                let corner = |bytes| Corner::from_zero(self.integer(bytes, item));
                row.corners.extend(items.map(corner));
            }
        }
        Ok(at)
    }

    /// The bytes of a number in little endian.
    #[inline]
    fn bytes<const N: usize>(&self, bytes: &[u8]) -> [u8; N] {
        let mut bytes: [u8; N] = *bytes
            .first_chunk()
            .expect("the caller has checked the length");
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes
    }

    /// A number, rounded to the nearest `f32`. One that does not fit becomes infinite and is refused later.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "rounding is intended"
    )]
    fn float(&self, bytes: &[u8], scalar: Scalar) -> f32 {
        match scalar {
            Scalar::F32 => f32::from_le_bytes(self.bytes(bytes)),
            Scalar::F64 => f64::from_le_bytes(self.bytes(bytes)) as f32,
            _ => self.integer(bytes, scalar) as f32,
        }
    }

    /// An integer; 0 for the types that are none.
    #[inline]
    fn integer(&self, bytes: &[u8], scalar: Scalar) -> i64 {
        match scalar {
            Scalar::I8 => i8::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::U8 => u8::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::I16 => i16::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::U16 => u16::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::I32 => i32::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::U32 => u32::from_le_bytes(self.bytes(bytes)).into(),
            Scalar::F32 | Scalar::F64 => 0,
        }
    }
}

/// The places of the values of a vertex, and its size, if it has no list.
fn places_of(element: &Element) -> Option<(Vec<Place>, usize)> {
    if element.name != "vertex" {
        return None;
    }
    let mut places = Vec::new();
    let mut offset = 0;
    for property in &element.properties {
        let Kind::Scalar(scalar) = property.kind else {
            return None;
        };
        if let Some(value) = super::place_of(&property.name) {
            places.push(Place {
                value,
                offset,
                scalar,
            });
        }
        offset += scalar.size();
    }
    Some((places, offset))
}
