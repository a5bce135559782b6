//! Rays from files.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use csv::{ReaderBuilder, StringRecord, Trim};
use kd::Ray;
use kd::glam::Vec3;
use npyz::{NpyFile, Order};

use super::RaySource;

/// Opens a file of rays.
pub(super) fn open(path: &Path) -> anyhow::Result<Box<dyn RaySource>> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let file = || -> anyhow::Result<_> {
        let file = File::open(path).with_context(|| format!("{}: cannot open", path.display()))?;
        Ok(BufReader::new(file))
    };
    match extension.to_str() {
        Some("csv" | "txt" | "tsv") => Ok(Box::new(CsvRays::new(file()?, path)?)),
        Some("npy") => NpyRays::open(file()?, path),
        _ => bail!(
            "{}: unknown format of rays; expected .csv, .npy, `camera` or `lidar`",
            path.display()
        ),
    }
}

/// The values of a ray, in this order.
const COLUMNS: [&str; 8] = ["ox", "oy", "oz", "dx", "dy", "dz", "t_min", "t_max"];

/// The ray of the values of [`COLUMNS`].
fn ray(values: [f32; 8]) -> anyhow::Result<Ray> {
    for (name, value) in COLUMNS.iter().zip(values) {
        let may_be_infinite = name.starts_with('t');
        if value.is_nan() || (value.is_infinite() && !may_be_infinite) {
            bail!("{name} is {value}, expected a finite number");
        }
    }
    let [ox, oy, oz, dx, dy, dz, t_min, t_max] = values;
    let direction = Vec3::new(dx, dy, dz);
    ensure!(direction != Vec3::ZERO, "the direction is zero");
    Ok(Ray {
        t_min,
        t_max,
        ..Ray::new([ox, oy, oz], direction)
    })
}

/// The values of a ray that a file does not give.
const DEFAULTS: [f32; 8] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY];

/// Rays in lines of numbers.
struct CsvRays<R> {
    path: PathBuf,
    reader: csv::Reader<R>,
    /// Whether blanks separate the values, one or more.
    has_blanks: bool,
    /// The place in a line of each value; those of t may be missing.
    places: [Option<usize>; 8],
    /// The number of values in each line, if the columns have no names.
    width: Option<usize>,
    /// The number of named columns.
    names: usize,
    record: StringRecord,
    /// Whether `record` is a ray that is not taken yet.
    is_pending: bool,
}

impl<R: BufRead> CsvRays<R> {
    fn new(mut reader: R, path: &Path) -> anyhow::Result<Self> {
        let name = || format!("{}", path.display());
        if reader
            .fill_buf()
            .with_context(name)?
            .starts_with("\u{feff}".as_bytes())
        {
            reader.consume(3);
        }
        let start = reader.fill_buf().with_context(name)?;
        let mut lines = start.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        let line = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
        let line = line.unwrap_or_default();
        let mut delimiters = [b',', b';', b'\t'].into_iter();
        let delimiter = delimiters.find(|byte| line.contains(byte)).unwrap_or(b' ');
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .delimiter(delimiter)
            .quoting(false)
            .trim(Trim::All)
            .flexible(true)
            .from_reader(reader);
        let mut rays = Self {
            path: path.to_owned(),
            reader,
            has_blanks: delimiter == b' ',
            places: [None; 8],
            width: None,
            names: 0,
            record: StringRecord::new(),
            is_pending: false,
        };
        rays.is_pending = rays.take()?;
        let is_number = |field: &str| field.parse::<f32>().is_ok();
        if rays.is_pending && !rays.record.iter().any(is_number) {
            rays.is_pending = false;
            rays.places = named_places(&rays.record).with_context(|| rays.place())?;
            rays.names = rays.record.len();
        } else if rays.is_pending {
            let width = rays.record.len();
            rays.width = Some(width);
            if ![6, 8].contains(&width) {
                bail!("{}: {width} values, expected 6 or 8", rays.place());
            }
            rays.places = std::array::from_fn(|place| (place < width).then_some(place));
        }
        Ok(rays)
    }

    /// Takes the next line that is no comment. Returns whether there is one.
    fn take(&mut self) -> anyhow::Result<bool> {
        loop {
            let read = self.reader.read_record(&mut self.record);
            if !read.with_context(|| format!("{}", self.path.display()))? {
                return Ok(false);
            }
            let is_empty = self.has_blanks && self.record.iter().all(str::is_empty);
            if is_empty
                || self
                    .record
                    .get(0)
                    .is_some_and(|first| first.starts_with('#'))
            {
                continue;
            }
            if self.has_blanks && self.record.iter().any(str::is_empty) {
                let position = self.record.position().cloned();
                self.record = self
                    .record
                    .iter()
                    .filter(|field| !field.is_empty())
                    .collect();
                self.record.set_position(position);
            }
            // A separator at the end of the line.
            let fields = self.record.len();
            if [7, 9].contains(&fields) && self.record.get(fields - 1) == Some("") {
                self.record.truncate(fields - 1);
            }
            return Ok(true);
        }
    }

    fn place(&self) -> String {
        let line = self.record.position().map_or(1, csv::Position::line);
        format!("{}: line {line}", self.path.display())
    }

    fn ray(&self) -> anyhow::Result<Ray> {
        let found = self.record.len();
        if let Some(width) = self.width.filter(|width| *width != found) {
            bail!("{found} values, expected {width} as in the first line");
        }
        if self.width.is_none() && found > self.names {
            bail!("{found} values, but {} columns have a name", self.names);
        }
        let mut values = DEFAULTS;
        for ((value, place), name) in values.iter_mut().zip(&self.places).zip(COLUMNS) {
            let Some(place) = place else {
                continue;
            };
            let field = self.record.get(*place);
            let field = field.with_context(|| format!("{name} is missing: {found} columns"))?;
            *value = field
                .parse()
                .with_context(|| format!("{name}: `{field}`"))?;
        }
        ray(values)
    }
}

/// The places of the columns with the names of [`COLUMNS`].
fn named_places(names: &StringRecord) -> anyhow::Result<[Option<usize>; 8]> {
    let names = names
        .iter()
        .map(|name| name.trim_start_matches('\u{feff}').trim_matches('"'));
    let names: Vec<&str> = names.collect();
    let place = |name: &str| {
        names
            .iter()
            .position(|other| other.eq_ignore_ascii_case(name))
    };
    let places = COLUMNS.map(place);
    if let Some(missing) = places[..6].iter().position(Option::is_none) {
        bail!(
            "no column `{}` among {}; expected {}",
            COLUMNS[missing],
            names.join(", "),
            COLUMNS.join(", ")
        );
    }
    Ok(places)
}

impl<R: BufRead> RaySource for CsvRays<R> {
    fn len(&self) -> Option<u64> {
        None
    }

    fn read(&mut self, most: usize, to: &mut Vec<Ray>) -> anyhow::Result<()> {
        for _ in 0..most {
            if !std::mem::take(&mut self.is_pending) && !self.take()? {
                break;
            }
            let ray = self.ray().with_context(|| self.place())?;
            to.push(ray);
        }
        Ok(())
    }
}

/// Rays in the rows of an array.
struct NpyRays<I> {
    path: PathBuf,
    values: I,
    rays: u64,
    next: u64,
    /// Values of a ray.
    width: usize,
}

impl NpyRays<()> {
    fn open(reader: impl BufRead + 'static, path: &Path) -> anyhow::Result<Box<dyn RaySource>> {
        let name = || format!("{}", path.display());
        let file = NpyFile::new(reader).with_context(name)?;
        let shape = file.shape().to_vec();
        let width = shape.last().copied().unwrap_or(0);
        if shape.len() < 2 || ![6, 8].contains(&width) {
            bail!(
                "{}: an array of shape {shape:?}, expected (N, 6) or (N, 8)",
                path.display()
            );
        }
        if file.order() != Order::C {
            bail!(
                "{}: an array in the order of Fortran, expected that of C",
                path.display()
            );
        }
        let mut rays = shape[..shape.len() - 1].iter();
        let rays = rays.try_fold(1_u64, |rays, more| rays.checked_mul(*more));
        let rays = rays.filter(|rays| rays.checked_mul(width).is_some());
        let rays = rays.with_context(|| {
            format!(
                "{}: an array of shape {shape:?} is too large",
                path.display()
            )
        })?;
        let width = usize::try_from(width)?;
        let path = path.to_owned();
        let file = match file.try_data::<f32>() {
            Ok(values) => {
                return Ok(Box::new(NpyRays {
                    path,
                    values,
                    rays,
                    next: 0,
                    width,
                }));
            }
            Err(file) => file,
        };
        #[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
        let narrow = |value: std::io::Result<f64>| value.map(|value| value as f32);
        match file.try_data::<f64>() {
            Ok(values) => {
                let values = values.map(narrow);
                Ok(Box::new(NpyRays {
                    path,
                    values,
                    rays,
                    next: 0,
                    width,
                }))
            }
            Err(file) => bail!(
                "{}: an array of {}, expected float32 or float64",
                path.display(),
                file.dtype().descr()
            ),
        }
    }
}

impl<I: Iterator<Item = std::io::Result<f32>>> RaySource for NpyRays<I> {
    fn len(&self) -> Option<u64> {
        Some(self.rays)
    }

    fn read(&mut self, most: usize, to: &mut Vec<Ray>) -> anyhow::Result<()> {
        let end = self.rays.min(self.next + most as u64);
        for number in self.next..end {
            let place = || format!("{}: row {number}", self.path.display());
            let mut values = DEFAULTS;
            for value in &mut values[..self.width] {
                let next = self
                    .values
                    .next()
                    .context("the file ends")
                    .with_context(place)?;
                *value = next.with_context(place)?;
            }
            to.push(ray(values).with_context(place)?);
        }
        self.next = end;
        Ok(())
    }
}
