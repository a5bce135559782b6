//! Hits to files.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use kd::glam::Vec3;
use kd::{Hit, Mesh, Ray};
use las::{Builder, Point, Transform, Vector};
use npyz::{AutoSerialize, Serialize};

use super::Answers;
use super::array::{ArrayWriter, Header};
use super::shard::Shard;

/// A file of hits.
pub(super) struct Output {
    path: PathBuf,
    kind: Kind,
}

enum Kind {
    /// Lines of numbers; a ray that hits nothing has empty fields.
    Csv(Box<csv::Writer<BufWriter<File>>>),
    /// An array of hits, in the order of rays.
    Npy(ArrayWriter<NpyHit>),
    /// An array of whether something is hit.
    NpyAny(ArrayWriter<bool>),
    /// The points that are hit.
    Las(las::Writer<BufWriter<File>>),
}

/// A format of hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Csv,
    Npy,
    Las,
}

impl Format {
    /// The format that an extension names.
    pub(super) fn of(path: &Path, any: bool) -> anyhow::Result<Self> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let path = path.display();
        match extension.to_str() {
            Some("csv") => Ok(Self::Csv),
            Some("npy") => Ok(Self::Npy),
            Some("las") if any => {
                bail!("{path}: LAS has points, and --any finds none; use .csv or .npy")
            }
            Some("las") => Ok(Self::Las),
            _ => bail!("{path}: unknown format of hits; use .csv, .npy or .las"),
        }
    }
}

/// A hit in an NPY file. A ray that hits nothing has an infinite `t`, the largest number of a triangle, and NaN for all else.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, AutoSerialize)]
#[cfg_attr(test, derive(npyz::Deserialize))]
struct NpyHit {
    ray: u64,
    t: f32,
    triangle: u32,
    u: f32,
    v: f32,
    x: f32,
    y: f32,
    z: f32,
    nx: f32,
    ny: f32,
    nz: f32,
}

const HEAD: [&str; 11] = [
    "ray", "t", "triangle", "u", "v", "x", "y", "z", "nx", "ny", "nz",
];

/// Where a ray hits a surface.
struct Place {
    at: Vec3,
    /// Unit normal of the triangle, towards the origin of the ray.
    normal: Vec3,
}

impl Place {
    fn new(mesh: &Mesh, ray: &Ray, hit: &Hit) -> Self {
        let normal = mesh.normal(hit.triangle).normalize_or_zero();
        // A hit behind the origin is seen from the other side.
        let onwards = if hit.t < 0.0 {
            -ray.direction
        } else {
            ray.direction
        };
        let is_behind = normal.dot(onwards) > 0.0;
        Self {
            at: mesh.surface_point(hit),
            normal: if is_behind { -normal } else { normal },
        }
    }
}

impl Output {
    /// Creates a file for answers to rays through `mesh`: those of a part, of this many rays in all if that is known. The files of all
    /// parts, one after the other, are the file of all rays.
    pub(super) fn create(
        path: &Path,
        format: Format,
        any: bool,
        mesh: &Mesh,
        (shard, rays): (Shard, Option<u64>),
    ) -> anyhow::Result<Self> {
        let header = match rays {
            _ if !shard.is_first() => Header::Before,
            Some(rays) => Header::Of(rays),
            None => Header::OfRows,
        };
        let create = || -> anyhow::Result<Kind> {
            let file = BufWriter::new(File::create(path)?);
            Ok(match format {
                Format::Csv => {
                    let mut writer = csv::Writer::from_writer(file);
                    if shard.is_first() {
                        writer.write_record(if any { &["ray", "occluded"][..] } else { &HEAD })?;
                    }
                    Kind::Csv(Box::new(writer))
                }
                Format::Npy if any => Kind::NpyAny(ArrayWriter::new(file, header)?),
                Format::Npy => Kind::Npy(ArrayWriter::new(file, header)?),
                Format::Las => Kind::Las(las::Writer::new(file, las_header(mesh)?)?),
            })
        };
        Ok(Self {
            path: path.to_owned(),
            kind: create().with_context(|| format!("{}", path.display()))?,
        })
    }

    /// Writes the answers to rays, the first of which has the number `first`.
    pub(super) fn write(
        &mut self,
        first: u64,
        rays: &[Ray],
        answers: &Answers,
        mesh: &Mesh,
    ) -> anyhow::Result<()> {
        let written = match answers {
            Answers::Any(occluded) => self.write_any(first, occluded),
            Answers::Closest(hits) => {
                (first..)
                    .zip(rays.iter().zip(hits))
                    .try_for_each(|(number, (ray, hit))| {
                        self.write_hit(number, ray, hit.as_ref(), mesh)
                    })
            }
        };
        written.with_context(|| format!("{}", self.path.display()))
    }

    fn write_any(&mut self, first: u64, occluded: &[bool]) -> anyhow::Result<()> {
        for (number, occluded) in (first..).zip(occluded) {
            match &mut self.kind {
                Kind::Csv(writer) => {
                    let is_hit = u8::from(*occluded).to_string();
                    writer.write_record([number.to_string(), is_hit])?;
                }
                Kind::NpyAny(writer) => writer.push(occluded)?,
                Kind::Npy(_) | Kind::Las(_) => unreachable!("made for closest hits"),
            }
        }
        Ok(())
    }

    fn write_hit(
        &mut self,
        number: u64,
        ray: &Ray,
        hit: Option<&Hit>,
        mesh: &Mesh,
    ) -> anyhow::Result<()> {
        let place = hit.map(|hit| (hit, Place::new(mesh, ray, hit)));
        match (&mut self.kind, place) {
            (Kind::Csv(writer), Some((hit, Place { at, normal }))) => {
                writer.write_field(number.to_string())?;
                writer.write_field(hit.t.to_string())?;
                writer.write_field(hit.triangle.to_string())?;
                for value in [hit.u, hit.v]
                    .into_iter()
                    .chain(at.to_array())
                    .chain(normal.to_array())
                {
                    writer.write_field(value.to_string())?;
                }
                writer.write_record(None::<&[u8]>)?;
            }
            (Kind::Csv(writer), None) => {
                let number = number.to_string();
                let empty = std::iter::repeat_n("", HEAD.len() - 1);
                writer.write_record(std::iter::once(number.as_str()).chain(empty))?;
            }
            (Kind::Npy(writer), place) => writer.push(&NpyHit::new(number, place))?,
            (Kind::Las(writer), Some((_, place))) => writer.write_point(point(ray, &place))?,
            (Kind::Las(_), None) => {}
            (Kind::NpyAny(_), _) => unreachable!("made for any hit"),
        }
        Ok(())
    }

    /// Writes the rest.
    pub(super) fn finish(self) -> anyhow::Result<()> {
        let written = match self.kind {
            Kind::Csv(writer) => writer
                .into_inner()
                .map_err(|error| anyhow::anyhow!("{}", error.error()))
                .and_then(|mut file| Ok(file.flush()?)),
            Kind::Npy(writer) => writer.finish(),
            Kind::NpyAny(writer) => writer.finish(),
            Kind::Las(mut writer) => writer.close().map_err(Into::into),
        };
        written.with_context(|| format!("{}", self.path.display()))
    }
}

impl NpyHit {
    fn new(ray: u64, place: Option<(&Hit, Place)>) -> Self {
        let Some((hit, Place { at, normal })) = place else {
            let [u, v, x, y, z, nx, ny, nz] = [f32::NAN; 8];
            return Self {
                ray,
                t: f32::INFINITY,
                triangle: u32::MAX,
                u,
                v,
                x,
                y,
                z,
                nx,
                ny,
                nz,
            };
        };
        let ([x, y, z], [nx, ny, nz]) = (at.to_array(), normal.to_array());
        let Hit { t, u, v, triangle } = *hit;
        Self {
            ray,
            t,
            triangle,
            u,
            v,
            x,
            y,
            z,
            nx,
            ny,
            nz,
        }
    }
}

/// A point of a LAS file. Its intensity is that of a white matt surface: the cosine of the angle to the normal.
fn point(ray: &Ray, place: &Place) -> Point {
    let cosine = place
        .normal
        .dot(-ray.direction.normalize_or_zero())
        .clamp(0.0, 1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 65535"
    )]
    let intensity = (cosine * f32::from(u16::MAX)).round() as u16;
    let [x, y, z] = place.at.to_array().map(f64::from);
    Point {
        x,
        y,
        z,
        intensity,
        return_number: 1,
        number_of_returns: 1,
        ..Point::default()
    }
}

/// A header whose integers have the finest decimal steps in which all points of the mesh fit.
fn las_header(mesh: &Mesh) -> anyhow::Result<las::Header> {
    let bounds = mesh.bounds();
    let is_empty = mesh.is_empty();
    let transform = |axis: usize| {
        let [low, high] = [bounds.min[axis], bounds.max[axis]].map(f64::from);
        let (middle, half) = if is_empty {
            (0.0, 0.0)
        } else {
            ((low + high) / 2.0, (high - low) / 2.0)
        };
        // Nine digits of 2^31; a scene without extent has a micrometer of meters.
        let digits = (half.max(1e3) / 2e9).log10().ceil();
        let scale = 10_f64.powf(digits.max(-9.0));
        Transform {
            scale,
            offset: (middle / scale).round() * scale,
        }
    };
    let mut builder = Builder::from((1, 2));
    builder.point_format = las::point::Format::new(0)?;
    builder.transforms = Vector {
        x: transform(0),
        y: transform(1),
        z: transform(2),
    };
    builder.system_identifier = "simulated".to_owned();
    builder.generating_software = format!("kd {}", env!("CARGO_PKG_VERSION"));
    builder.date = None;
    Ok(builder.into_header()?)
}
