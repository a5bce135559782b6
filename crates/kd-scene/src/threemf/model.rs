//! The XML of a model in a 3MF archive (3MF Core Specification, §3 to §5).

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::io::{BufReader, Read};

use glam::{DAffine3, DMat3, DVec3};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader as XmlReader, XmlVersion};

use crate::LoadError;
use crate::report::{Place, Report, WarningCode};

/// A model: objects by their ids, and what is built of them.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) objects: HashMap<u32, Object>,
    pub(super) items: Vec<Item>,
}

/// An object, placed.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) object: u32,
    /// The model that has the object, if it is another one.
    pub(super) path: Option<String>,
    pub(super) transform: DAffine3,
}

/// An object: triangles, or placed objects.
#[derive(Debug, Default)]
pub(super) struct Object {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) components: Vec<Item>,
}

impl Object {
    /// The number of its own vertices and triangles.
    pub(super) fn elements(&self) -> usize {
        self.positions.len() + self.triangles.len()
    }

    /// The components, with the path of the model that has each; `path` is that of this object.
    pub(super) fn components_in(&self, path: &str) -> Vec<Item> {
        let components = self.components.iter().map(|component| Item {
            path: Some(component.path.clone().unwrap_or_else(|| path.to_owned())),
            ..component.clone()
        });
        components.collect()
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Indices of vertices, which may not exist.
    pub(super) corners: [u32; 3],
    pub(super) colors: [Option<Color>; 3],
}

/// Red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Color(pub(super) [u8; 3]);

impl Color {
    pub(super) const WHITE: Self = Self([255; 3]);

    /// `#RRGGBB` or `#RRGGBBAA`.
    fn of(text: &str) -> Option<Self> {
        let digits = text.trim().strip_prefix('#')?;
        let byte = |i: usize| u8::from_str_radix(digits.get(2 * i..2 * i + 2)?, 16).ok();
        Some(Self([byte(0)?, byte(1)?, byte(2)?]))
    }
}

/// Extensions whose parts are read, or change no geometry.
const EXTENSIONS: [&str; 4] = [
    "http://schemas.microsoft.com/3dmanufacturing/core/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

/// Elements of extensions that are left out.
const UNUSED: [&str; 8] = [
    "beamlattice",
    "booleans",
    "compositematerials",
    "displacementmesh",
    "multiproperties",
    "slicestack",
    "texture2dgroup",
    "volumetricstack",
];

impl Model {
    /// Reads the XML of a model; errors name it `file`.
    pub(super) fn read(xml: impl Read, file: &str, report: &mut Report) -> Result<Self, LoadError> {
        let mut xml = XmlReader::from_reader(BufReader::new(xml));
        let mut parser = Parser {
            file,
            report,
            model: Self::default(),
            object: None,
            group: 0,
            colors: HashMap::new(),
            unused: HashSet::new(),
        };
        let mut buffer = Vec::new();
        let mut has_model = false;
        // How many elements are open that nothing is read of.
        let mut skipped = 0_usize;
        loop {
            buffer.clear();
            match xml.read_event_into(&mut buffer) {
                Ok(Event::Start(_)) if skipped > 0 => skipped += 1,
                Ok(Event::End(_)) if skipped > 0 => skipped -= 1,
                Ok(Event::Empty(_)) if skipped > 0 => {}
                Ok(Event::Start(element)) => {
                    has_model |= element.local_name().as_ref() == "model";
                    parser.start(&element)?;
                    skipped = usize::from(UNUSED.contains(&element.local_name().as_ref()));
                }
                Ok(Event::Empty(element)) => {
                    parser.start(&element)?;
                    parser.end(element.local_name().as_ref());
                }
                Ok(Event::End(element)) => parser.end(element.local_name().as_ref()),
                Ok(Event::Eof) => break,
                Ok(_) => {}
                Err(error) => {
                    return Err(LoadError::BadElement {
                        file: file.to_owned(),
                        element: "byte".to_owned(),
                        index: usize::try_from(xml.error_position().max(xml.buffer_position()))
                            .unwrap_or(usize::MAX),
                        problem: error.to_string(),
                    });
                }
            }
        }
        if !has_model || parser.object.is_some() {
            return Err(LoadError::BadHeader {
                file: file.to_owned(),
                problem: "expected a whole `model`".to_owned(),
            });
        }
        Ok(parser.model)
    }
}

/// The path of the model in the relations of an archive.
pub(super) fn root_of_relations(text: &[u8]) -> Option<String> {
    const KIND: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
    let mut xml = XmlReader::from_reader(text);
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        match xml.read_event_into(&mut buffer).ok()? {
            Event::Start(element) | Event::Empty(element) => {
                let attributes = Attributes(&element);
                if attributes.get("Type").as_deref() == Some(KIND) {
                    return attributes.get("Target");
                }
            }
            Event::Eof => return None,
            _ => {}
        }
    }
}

struct Parser<'a> {
    file: &'a str,
    report: &'a mut Report,
    model: Model,
    /// The object that is open.
    object: Option<OpenObject>,
    /// The id of the group of colors that is open.
    group: u32,
    /// The colors of each group.
    colors: HashMap<u32, Vec<Option<Color>>>,
    /// Groups of textures and the like, which are not read.
    unused: HashSet<u32>,
}

struct OpenObject {
    id: u32,
    object: Object,
    /// The group and the number of the color of triangles without their own.
    color: Option<(u32, u32)>,
}

impl Parser<'_> {
    fn start(&mut self, element: &BytesStart<'_>) -> Result<(), LoadError> {
        let attributes = Attributes(element);
        let name = element.local_name();
        let name = name.as_ref();
        match name {
            "model" => self.check_extensions(&attributes)?,
            "basematerials" | "colorgroup" => {
                self.group = self.number(&attributes, "id", name, 0)?;
                self.colors.insert(self.group, Vec::new());
            }
            "base" | "color" => {
                let text = attributes
                    .get("displaycolor")
                    .or_else(|| attributes.get("color"));
                let color = text.as_deref().and_then(Color::of);
                if color.is_none() {
                    let what = "a color is not of the form #RRGGBB; it is light gray";
                    self.report
                        .warn(self.file, None, WarningCode::BadMaterial, what);
                }
                self.colors.entry(self.group).or_default().push(color);
            }
            "object" => {
                let id = self.number(&attributes, "id", "object", 0)?;
                let index = attributes.parse("pindex").unwrap_or(0);
                self.object = Some(OpenObject {
                    id,
                    object: Object::default(),
                    color: attributes.parse("pid").map(|group| (group, index)),
                });
            }
            "vertex" => self.vertex(&attributes)?,
            "triangle" => self.triangle(&attributes)?,
            "component" => {
                let item = self.item(&attributes, "component")?;
                if let Some(open) = &mut self.object {
                    open.object.components.push(item);
                }
            }
            "item" => {
                let item = self.item(&attributes, "item")?;
                self.model.items.push(item);
            }
            other if UNUSED.contains(&other) => {
                self.unused.extend(attributes.parse::<u32>("id"));
                let what = format!("`{other}` is not used");
                self.report.warn(self.file, None, WarningCode::Unused, what);
            }
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str) {
        if name == "object"
            && let Some(open) = self.object.take()
        {
            self.model.objects.insert(open.id, open.object);
        }
    }

    /// Refuses extensions that the model requires and that are not supported.
    fn check_extensions(&mut self, attributes: &Attributes<'_>) -> Result<(), LoadError> {
        let required = attributes.get("requiredextensions").unwrap_or_default();
        for prefix in required.split_ascii_whitespace() {
            let name = attributes.get_full(&format!("xmlns:{prefix}"));
            let name = name.unwrap_or_else(|| prefix.to_owned());
            if EXTENSIONS.contains(&name.as_str()) {
                continue;
            }
            let error = LoadError::BadHeader {
                file: self.file.to_owned(),
                problem: format!("the required extension {name} is not supported"),
            };
            let what = format!("the extension {name} is required; it is not used");
            self.report
                .leave_out(error, None, WarningCode::Unused, &what)?;
        }
        Ok(())
    }

    fn vertex(&mut self, attributes: &Attributes<'_>) -> Result<(), LoadError> {
        let number = self
            .object
            .as_ref()
            .map_or(0, |open| open.object.positions.len());
        let mut position = [0.0; 3];
        for (coordinate, name) in position.iter_mut().zip(["x", "y", "z"]) {
            *coordinate = self.number(attributes, name, "vertex", number)?;
        }
        if let Some(open) = &mut self.object {
            open.object.positions.push(position);
        }
        Ok(())
    }

    fn triangle(&mut self, attributes: &Attributes<'_>) -> Result<(), LoadError> {
        let Some(open) = &self.object else {
            return Ok(());
        };
        let number = open.object.triangles.len();
        let mut corners = [0; 3];
        for (corner, name) in corners.iter_mut().zip(["v1", "v2", "v3"]) {
            *corner = self.number(attributes, name, "triangle", number)?;
        }
        let mut is_lost = false;
        let mut color = |group: u32, index: u32| {
            let colors = self.colors.get(&group);
            let found = colors.and_then(|colors| colors.get(index as usize));
            is_lost |= found.is_none() && !self.unused.contains(&group);
            found.copied().flatten()
        };
        let group = attributes
            .parse("pid")
            .or(open.color.map(|(group, _)| group));
        let first: Option<u32> = attributes.parse("p1");
        let colors = match (group.zip(first), open.color) {
            (Some((group, first)), _) => {
                ["p1", "p2", "p3"].map(|name| color(group, attributes.parse(name).unwrap_or(first)))
            }
            (None, Some((group, index))) => [color(group, index); 3],
            (None, None) => [None; 3],
        };
        if is_lost {
            let what = "a triangle names a color that is not there; it is light gray";
            let place = Some(Place::Element("triangle".to_owned(), number));
            self.report
                .warn(self.file, place, WarningCode::UnknownMaterial, what);
        }
        if let Some(open) = &mut self.object {
            open.object.triangles.push(Triangle { corners, colors });
        }
        Ok(())
    }

    fn item(&mut self, attributes: &Attributes<'_>, element: &str) -> Result<Item, LoadError> {
        let object = self.number(attributes, "objectid", element, 0)?;
        let path = attributes.get("path");
        let transform = match attributes.get("transform") {
            Some(text) => {
                let numbers = text.split_ascii_whitespace().map(|word| word.parse().ok());
                let numbers: Option<Vec<f64>> = numbers.collect();
                let numbers = numbers.and_then(|all| <[f64; 12]>::try_from(all).ok());
                transform(numbers.ok_or_else(|| self.bad(element, 0, "transform"))?)
            }
            None => DAffine3::IDENTITY,
        };
        Ok(Item {
            object,
            path: path.map(|path| path.trim_start_matches('/').to_owned()),
            transform,
        })
    }

    /// A number that an element must have.
    fn number<T: std::str::FromStr>(
        &self,
        attributes: &Attributes<'_>,
        name: &str,
        element: &str,
        index: usize,
    ) -> Result<T, LoadError> {
        attributes
            .parse(name)
            .ok_or_else(|| self.bad(element, index, name))
    }

    fn bad(&self, element: &str, index: usize, attribute: &str) -> LoadError {
        LoadError::BadElement {
            file: self.file.to_owned(),
            element: element.to_owned(),
            index,
            problem: format!("`{attribute}` is missing, or not valid"),
        }
    }
}

/// A transform by its twelve numbers: the images of the axes, then of the origin.
fn transform(numbers: [f64; 12]) -> DAffine3 {
    let row = |first: usize| DVec3::from_slice(&numbers[first..]);
    DAffine3 {
        matrix3: DMat3::from_cols(row(0), row(3), row(6)),
        translation: row(9),
    }
}

/// The attributes of an element.
struct Attributes<'a>(&'a BytesStart<'a>);

impl Attributes<'_> {
    /// An attribute by its name without a prefix.
    fn get(&self, name: &str) -> Option<String> {
        self.find(|key| key.rsplit(':').next() == Some(name))
    }

    /// An attribute by its name with its prefix.
    fn get_full(&self, name: &str) -> Option<String> {
        self.find(|key| key == name)
    }

    fn find(&self, is_it: impl Fn(&str) -> bool) -> Option<String> {
        let mut all = self.0.attributes();
        let mut all = all.with_checks(false).flatten();
        let found = all.find(|attribute| is_it(attribute.key.as_ref()))?;
        let text = found
            .normalized_value(XmlVersion::Implicit1_0)
            .map(Cow::into_owned);
        Some(text.unwrap_or_else(|_| found.value.into_owned()))
    }

    fn parse<T: std::str::FromStr>(&self, name: &str) -> Option<T> {
        self.get(name)?.trim().parse().ok()
    }
}
