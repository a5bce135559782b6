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

/// The ray of six or eight values.
fn ray(values: &[f32]) -> anyhow::Result<Ray> {
    let mut all = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY];
    all[..values.len()].copy_from_slice(values);
    for (name, value) in COLUMNS.iter().zip(all) {
        let may_be_infinite = name.starts_with('t');
        if value.is_nan() || (value.is_infinite() && !may_be_infinite) {
            bail!("{name} is {value}, expected a finite number");
        }
    }
    let [ox, oy, oz, dx, dy, dz, t_min, t_max] = all;
    let direction = Vec3::new(dx, dy, dz);
    ensure!(direction != Vec3::ZERO, "the direction is zero");
    Ok(Ray {
        t_min,
        t_max,
        ..Ray::new([ox, oy, oz], direction)
    })
}

/// Rays in lines of numbers.
struct CsvRays<R> {
    path: PathBuf,
    reader: csv::Reader<R>,
    /// Whether blanks separate the values, one or more.
    has_blanks: bool,
    /// The place in a line of each of the values; those of t are optional.
    places: Vec<usize>,
    record: StringRecord,
    /// Whether `record` is a ray that is not taken yet.
    is_pending: bool,
}

impl<R: BufRead> CsvRays<R> {
    fn new(mut reader: R, path: &Path) -> anyhow::Result<Self> {
        let start = reader
            .fill_buf()
            .with_context(|| format!("{}", path.display()))?;
        let mut lines = start.split(|byte| *byte == b'\n');
        let line = lines
            .find(|line| !line.starts_with(b"#"))
            .unwrap_or_default();
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
            places: (0..6).collect(),
            record: StringRecord::new(),
            is_pending: false,
        };
        rays.is_pending = rays.take()?;
        let is_number = |field: &str| field.parse::<f32>().is_ok();
        if rays.is_pending && !rays.record.iter().all(is_number) {
            rays.is_pending = false;
            rays.places = named_places(&rays.record).with_context(|| rays.place())?;
        } else if rays.record.len() >= 8 {
            rays.places = (0..8).collect();
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
            if self
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
            return Ok(true);
        }
    }

    fn place(&self) -> String {
        let line = self.record.position().map_or(1, csv::Position::line);
        format!("{}: line {line}", self.path.display())
    }

    fn ray(&self) -> anyhow::Result<Ray> {
        let mut values = [0.0; 8];
        for ((value, place), name) in values.iter_mut().zip(&self.places).zip(COLUMNS) {
            let field = self.record.get(*place);
            let field = field
                .with_context(|| format!("{name} is missing: {} columns", self.record.len()))?;
            *value = field
                .parse()
                .with_context(|| format!("{name}: `{field}`"))?;
        }
        ray(&values[..self.places.len()])
    }
}

/// The places of the columns with the names of [`COLUMNS`].
fn named_places(names: &StringRecord) -> anyhow::Result<Vec<usize>> {
    let place = |name: &str| {
        names
            .iter()
            .position(|other| other.eq_ignore_ascii_case(name))
    };
    let mut places = Vec::new();
    for name in &COLUMNS[..6] {
        let found = place(name).with_context(|| {
            let found: Vec<&str> = names.iter().collect();
            format!(
                "no column `{name}` among {}; expected {}",
                found.join(", "),
                COLUMNS.join(", ")
            )
        })?;
        places.push(found);
    }
    if let [Some(near), Some(far)] = [place("t_min"), place("t_max")] {
        places.extend([near, far]);
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
        let rays = shape[..shape.len() - 1].iter().product();
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
            let mut values = [0.0; 8];
            for value in &mut values[..self.width] {
                let next = self
                    .values
                    .next()
                    .context("the file ends")
                    .with_context(place)?;
                *value = next.with_context(place)?;
            }
            to.push(ray(&values[..self.width]).with_context(place)?);
        }
        self.next = end;
        Ok(())
    }
}
