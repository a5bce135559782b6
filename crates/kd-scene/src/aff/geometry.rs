//! Everything that has triangles.

use std::rc::Rc;

use glam::{DVec3, Vec3};

use super::polygon;
use super::words::Words;
use super::{Around, Reader, narrow, place, vector};
use crate::draft::{Draft, Look, Place};
use crate::tessellate::{UnitSphere, around as directions_around};
use crate::{LoadError, MorphKey, Surface};

impl Reader<'_> {
    /// `s`: a sphere. One of negative radius is seen from inside.
    pub(super) fn sphere(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
    ) -> Result<(), LoadError> {
        let center = vector(words, "the centre of a sphere")?;
        let radius = words.number("the radius of a sphere")?;
        let resolution = self.options.resolution.max(1);
        let cells = (resolution as usize).saturating_mul(resolution as usize);
        self.count_triangles(words, cells.saturating_mul(12))?;
        let unit = Rc::clone(
            self.unit_sphere
                .get_or_insert_with(|| Rc::new(UnitSphere::new(resolution))),
        );
        let look = self.look(Surface::NO_TEXTURE);
        let place = place(around);
        let draft = self.draft(around, false);
        let vertices = unit.directions.iter().map(|direction| {
            let at = place.position(center + radius.abs() * *direction);
            (at, place.normal(*direction * radius.signum()))
        });
        let vertices = add(draft, words, vertices)?;
        for corners in &unit.triangles {
            let corners = corners.map(|corner| vertices[corner as usize]);
            add_smooth(draft, corners, radius < 0.0, look);
        }
        Ok(())
    }

    /// `c`: the side of a cone or cylinder, without its ends. One of negative radii is seen from inside.
    pub(super) fn cone(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        let mut end = || -> Result<(DVec3, f64), LoadError> {
            let center = vector(words, "the end of a cone")?;
            Ok((center, words.number("the radius of a cone")?))
        };
        let (base, tip) = (end()?, end()?);
        let axis = tip.0 - base.0;
        if axis == DVec3::ZERO {
            return Err(words.error("both ends of a cone are at the same place"));
        }
        let resolution = self.options.resolution.max(1);
        self.count_triangles(words, (resolution as usize).saturating_mul(8))?;
        let look = self.look(Surface::NO_TEXTURE);
        let place = place(around);
        let draft = self.draft(around, false);
        let is_inside = base.1 < 0.0 || tip.1 < 0.0;
        let radii = [base.1.abs(), tip.1.abs()];
        // How much the side leans.
        let lean = axis * ((radii[0] - radii[1]) / axis.length_squared());
        let vertices = directions_around(axis, resolution).flat_map(|outwards| {
            let normal = place.normal((outwards + lean) * if is_inside { -1.0 } else { 1.0 });
            let ends = [base.0 + radii[0] * outwards, tip.0 + radii[1] * outwards];
            ends.map(|at| (place.position(at), normal))
        });
        let vertices = add(draft, words, vertices)?;
        for side in 0..vertices.len() / 2 {
            let at = |i: usize| vertices[(2 * side + i) % vertices.len()];
            let [low, high, next_low, next_high] = [0, 1, 2, 3].map(at);
            add_smooth(draft, [low, next_low, next_high], is_inside, look);
            add_smooth(draft, [low, next_high, high], is_inside, look);
        }
        Ok(())
    }

    /// `p`: a flat polygon.
    pub(super) fn polygon(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
    ) -> Result<(), LoadError> {
        self.any_polygon(words, around, false)
    }

    /// `pp`: a polygon with normals.
    pub(super) fn patch(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        self.any_polygon(words, around, true)
    }

    fn any_polygon(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
        has_normals: bool,
    ) -> Result<(), LoadError> {
        let count = words.count("the number of corners")?;
        if count < 3 {
            return Err(words.error(format!(
                "a polygon of {count} corners, at least 3 are needed"
            )));
        }
        let place = place(around);
        let (mut corners, mut normals) = (Vec::new(), Vec::new());
        for _ in 0..count {
            corners.push(place.position(vector(words, "a corner")?));
            if has_normals {
                normals.push(place.normal(vector(words, "a normal")?));
            }
        }
        self.count_triangles(words, count - 2)?;
        let look = self.look(Surface::NO_TEXTURE);
        let draft = self.draft(around, false);
        normals.resize(count, Vec3::ZERO);
        let vertices = corners.iter().copied().zip(normals);
        let vertices = add(draft, words, vertices)?;
        for triangle in polygon::triangles(&corners) {
            let corners = triangle.map(|corner| vertices[corner]);
            draft.triangle(corners.map(|(vertex, _)| vertex), look);
            if has_normals {
                draft.set_normals(corners.map(|(_, normal)| normal));
            }
        }
        Ok(())
    }

    /// `tt` and `ttp`: a triangle with a texture.
    pub(super) fn textured_triangle(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
        has_normals: bool,
    ) -> Result<(), LoadError> {
        let texture = words.text("the name of a texture")?;
        let texture = self.texture(texture);
        let place = place(around);
        let mut vertices = [(DVec3::ZERO, Vec3::ZERO); 3];
        let mut uvs = [[0.0; 2]; 3];
        for ((at, normal), uv) in vertices.iter_mut().zip(&mut uvs) {
            *at = place.position(vector(words, "a corner")?);
            if has_normals {
                *normal = place.normal(vector(words, "a normal")?);
            }
            *uv = words.numbers::<2>("a place in a texture")?.map(narrow);
        }
        self.count_triangles(words, 1)?;
        let look = self.look(texture);
        let draft = self.draft(around, false);
        let vertices = add(draft, words, vertices)?;
        let at = |i: usize| vertices[i];
        draft.triangle([0, 1, 2].map(|i| at(i).0), look);
        draft.set_uvs(uvs);
        if has_normals {
            draft.set_normals([0, 1, 2].map(|i| at(i).1));
        }
        Ok(())
    }

    /// `m`: vertices, normals and places in a texture, and triangles that name them by their numbers.
    pub(super) fn mesh(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        let place = place(around);
        words.expect("vertices")?;
        let positions = rows(words, "a vertex", |words| vector(words, "a vertex"))?;
        let mut normals = None;
        if words.take_if("normals") {
            let row = |words: &mut Words<'_>| Ok(place.normal(vector(words, "a normal")?));
            normals = Some(rows(words, "a normal", row)?);
        }
        let mut texture = Surface::NO_TEXTURE;
        let mut uvs = None;
        if words.take_if("texturecoords") {
            let count = words.count("the number of places in a texture")?;
            let name = words.text("the name of a texture")?;
            texture = self.texture(name);
            let mut all = Vec::new();
            for _ in 0..count {
                all.push(words.numbers::<2>("a place in a texture")?.map(narrow));
            }
            uvs = Some(all);
        }
        words.expect("triangles")?;
        let look = self.look(texture);
        let vertices = {
            let positions = positions.iter().map(|at| (place.position(*at), Vec3::ZERO));
            add(self.draft(around, false), words, positions)?
        };
        for face in 0..words.count("the number of triangles")? {
            self.count_triangles(words, 1)?;
            let draft = self.draft(around, false);
            let corners = corners(words, face, &vertices)?;
            draft.triangle(corners.map(|(vertex, _)| vertex), look);
            if let Some(normals) = &normals {
                draft.set_normals(self::corners(words, face, normals)?);
            }
            if let Some(uvs) = &uvs {
                draft.set_uvs(self::corners(words, face, uvs)?);
            }
        }
        Ok(())
    }

    /// `tpa`: a triangle that goes from one shape to the next.
    pub(super) fn morphing_triangle(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
    ) -> Result<(), LoadError> {
        let count = words.count("the number of keys")?;
        if count == 0 {
            return Err(words.error("a triangle without keys"));
        }
        let place = place(around);
        let mut keys: Vec<MorphKey> = Vec::new();
        for _ in 0..count {
            keys.push(morph_key(words, &place)?);
            if let [.., before, last] = keys.as_slice()
                && before.time > last.time
            {
                return Err(words.error("the times of keys descend"));
            }
        }
        self.count_triangles(words, 1)?;
        let look = self.look(Surface::NO_TEXTURE);
        let draft = self.draft(around, true);
        let first = keys[0]
            .corners
            .map(|corner| (corner.as_dvec3(), Vec3::ZERO));
        let vertices = add(draft, words, first)?;
        draft.triangle([0, 1, 2].map(|i| vertices[i].0), look);
        draft.set_keys(keys);
        Ok(())
    }
}

fn morph_key(words: &mut Words<'_>, place: &Place) -> Result<MorphKey, LoadError> {
    let time = words.number("the time of a key")?;
    let (mut corners, mut normals) = ([Vec3::ZERO; 3], [Vec3::ZERO; 3]);
    for (corner, normal) in corners.iter_mut().zip(&mut normals) {
        *corner = place.position(vector(words, "a corner")?).as_vec3();
        *normal = place.normal(vector(words, "a normal")?);
        if !corner.is_finite() {
            return Err(words.error("a corner is too far away"));
        }
    }
    Ok(MorphKey {
        time,
        corners,
        normals,
    })
}

/// Rows of one kind, after their number.
fn rows<T>(
    words: &mut Words<'_>,
    what: &str,
    row: impl Fn(&mut Words<'_>) -> Result<T, LoadError>,
) -> Result<Vec<T>, LoadError> {
    let count = words.count(&format!("how often {what} comes"))?;
    // Not room for as many as a file claims.
    let mut all = Vec::new();
    for _ in 0..count {
        all.push(row(words)?);
    }
    Ok(all)
}

/// What three numbers name.
fn corners<T: Copy>(words: &mut Words<'_>, face: usize, of: &[T]) -> Result<[T; 3], LoadError> {
    let mut found = [None; 3];
    for corner in &mut found {
        let index = words.count("a corner of a triangle")?;
        *corner = of.get(index).copied();
        if corner.is_none() {
            return Err(LoadError::IndexOutOfRange {
                file: words.file.to_owned(),
                line: Some(words.last_line),
                face,
                index: i64::try_from(index).unwrap_or(i64::MAX),
                vertices: of.len(),
            });
        }
    }
    Ok(found.map(|corner| corner.expect("each was found")))
}

/// Adds vertices with normals, and gives their numbers.
fn add(
    draft: &mut Draft,
    words: &Words<'_>,
    vertices: impl IntoIterator<Item = (DVec3, Vec3)>,
) -> Result<Vec<(u32, Vec3)>, LoadError> {
    let numbered = vertices.into_iter().map(|(at, normal)| {
        let number = draft.vertex(at);
        let number =
            number.ok_or_else(|| words.error("a vertex is too far away, or one too many"))?;
        Ok((number, normal))
    });
    numbered.collect()
}

/// A triangle of vertices with normals, turned round if it is seen from the other side.
fn add_smooth(draft: &mut Draft, corners: [(u32, Vec3); 3], is_turned: bool, look: Look) {
    let [a, b, c] = corners;
    let corners = if is_turned { [a, c, b] } else { [a, b, c] };
    draft.triangle(corners.map(|(vertex, _)| vertex), look);
    draft.set_normals(corners.map(|(_, normal)| normal));
}
