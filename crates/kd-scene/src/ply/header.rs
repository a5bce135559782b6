//! The header of a PLY file.

use crate::LoadError;
use crate::error::quoted;
use crate::report::{Place, Report, WarningCode};
use crate::source::{LineEnd, Source};
use crate::words::Words;

/// How the data are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// The type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// The elements of a kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The number of lines, up to `end_header`.
    pub(super) lines: usize,
}

/// Reads a header, and takes it from the source. Comments, blank lines and blanks around lines are skipped.
/// A lenient reader also skips lines that are none of a header.
pub(super) fn read_header(
    source: &mut Source<'_>,
    report: &mut Report,
) -> Result<Header, LoadError> {
    let name = source.name;
    source.take_byte_order_mark()?;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let (mut lines, mut statements) = (0, 0);
    let mut last_end = LineEnd::None;
    while let Some((line, end)) = source.line()? {
        lines += 1;
        let line = source.text(line).trim_ascii();
        let mut words = Words::new(line);
        let Some(keyword) = words
            .next()
            .filter(|word| !matches!(*word, b"comment" | b"obj_info"))
        else {
            last_end = end;
            continue;
        };
        statements += 1;
        let words: Vec<&[u8]> = words.collect();
        let bad = || LoadError::BadLine {
            file: name.to_owned(),
            line: lines,
            problem: format!("bad header line: {}", quoted(line)),
        };
        match (statements, keyword, words.as_slice()) {
            (1, b"ply", []) => {}
            (1, ..) => return Err(bad()),
            (2, b"format", [kind, _version]) => {
                encoding = Some(encoding_of(kind).ok_or_else(bad)?);
            }
            (_, b"element", [name, count]) => {
                let count = std::str::from_utf8(count)
                    .ok()
                    .and_then(|count| count.parse().ok());
                elements.push(Element {
                    name: text(name),
                    count: count.ok_or_else(bad)?,
                    properties: Vec::new(),
                });
            }
            (_, b"property", words) => {
                let property = property_of(words).ok_or_else(bad)?;
                elements
                    .last_mut()
                    .ok_or_else(bad)?
                    .properties
                    .push(property);
            }
            (_, b"end_header", []) => {
                // Where lines end in `\r`, the `\n` after the last one is data.
                if end == LineEnd::Both && last_end == LineEnd::CarriageReturn {
                    source.give_back_line_feed();
                }
                let missing = || LoadError::BadHeader {
                    file: name.to_owned(),
                    problem: "`format` is missing".to_owned(),
                };
                let encoding = encoding.ok_or_else(missing)?;
                refuse_duplicates(&elements, name)?;
                return Ok(Header {
                    encoding,
                    elements,
                    lines,
                });
            }
            _ => {
                let what = "a line of the header has no meaning; it is left out";
                let place = Some(Place::Line(lines));
                report.leave_out(bad(), place, WarningCode::BadElement, what)?;
            }
        }
        last_end = end;
    }
    Err(LoadError::BadHeader {
        file: name.to_owned(),
        problem: "`end_header` is missing".to_owned(),
    })
}

fn encoding_of(word: &[u8]) -> Option<Encoding> {
    Some(match word {
        b"ascii" => Encoding::Text,
        b"binary_little_endian" => Encoding::LittleEndian,
        b"binary_big_endian" => Encoding::BigEndian,
        _ => return None,
    })
}

fn property_of(words: &[&[u8]]) -> Option<Property> {
    let (kind, name) = match words {
        [b"list", count, item, name] => {
            let (count, item) = (Scalar::of(count)?, Scalar::of(item)?);
            (Kind::List { count, item }, name)
        }
        [scalar, name] => (Kind::Scalar(Scalar::of(scalar)?), name),
        _ => return None,
    };
    Some(Property {
        name: text(name),
        kind,
    })
}

/// Refuses two elements, or two properties of an element, of the same name.
fn refuse_duplicates(elements: &[Element], file: &str) -> Result<(), LoadError> {
    let has_duplicates = |mut names: Vec<&str>| {
        names.sort_unstable();
        names.windows(2).any(|pair| pair[0] == pair[1])
    };
    let properties = |element: &Element| {
        has_duplicates(
            element
                .properties
                .iter()
                .map(|it| it.name.as_str())
                .collect(),
        )
    };
    let names = elements.iter().map(|it| it.name.as_str()).collect();
    if has_duplicates(names) || elements.iter().any(properties) {
        return Err(LoadError::BadHeader {
            file: file.to_owned(),
            problem: "two elements or two properties have the same name".to_owned(),
        });
    }
    Ok(())
}

fn text(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

impl Scalar {
    fn of(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// The number of bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl Element {
    /// The type of a property; `None` if there is none of that name.
    pub(super) fn kind_of(&self, name: &str) -> Option<Kind> {
        let found = self
            .properties
            .iter()
            .find(|property| property.name == name);
        found.map(|property| property.kind)
    }

    /// The number of bytes of an element with empty lists.
    pub(super) fn least_size(&self) -> usize {
        let sizes = self.properties.iter().map(|property| match property.kind {
            Kind::Scalar(scalar) => scalar.size(),
            Kind::List { count, .. } => count.size(),
        });
        sizes.sum()
    }

    /// The number of bytes of an item of the list of corners.
    pub(super) fn item_size(&self) -> usize {
        let items = self
            .properties
            .iter()
            .filter(|it| super::is_corner_list(&it.name));
        let sizes = items.filter_map(|property| match property.kind {
            Kind::Scalar(_) => None,
            Kind::List { item, .. } => Some(item.size()),
        });
        sizes.sum()
    }
}
