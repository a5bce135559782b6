//! Commands that produce triangles.

use std::rc::Rc;

use glam::{DVec3, Vec3};

use super::motion::TIMES_DESCEND;
use super::tokens::Tokens;
use super::{Enclosing, Reader, narrow, transform, vector};
use crate::draft::{PartDraft, SurfaceIds, Transform};
use crate::polygon::triangulate;
use crate::report::WarningCode;
use crate::tessellate::{UnitSphere, circle_directions};
use crate::{LoadError, MorphKey, Surface};

impl Reader<'_> {
    /// `s`: a sphere. A negative radius turns its surface inside out.
    pub(super) fn sphere(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let center = vector(tokens, "the center of a sphere")?;
        let radius = tokens.number("the radius of a sphere")?;
        let resolution = self.options.resolution.max(1);
        let cells = (resolution as usize).saturating_mul(resolution as usize);
        self.count_triangles(tokens, cells.saturating_mul(12))?;
        let unit = Rc::clone(
            self.unit_sphere
                .get_or_insert_with(|| Rc::new(UnitSphere::new(resolution))),
        );
        let ids = self.surface_ids(Surface::NO_TEXTURE);
        let transform = transform(enclosing);
        let draft = self.draft(enclosing, false);
        let vertices = unit.directions.iter().map(|direction| {
            let at = transform.position(center + radius.abs() * *direction);
            (at, transform.normal(*direction * radius.signum()))
        });
        let vertices = add(draft, tokens, vertices)?;
        for corners in &unit.triangles {
            let corners = corners.map(|corner| vertices[corner as usize]);
            add_smooth(draft, corners, radius < 0.0, ids);
        }
        Ok(())
    }

    /// `c`: a cone or cylinder without caps. Negative radii turn its surface inside out.
    pub(super) fn cone(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let mut end = || -> Result<(DVec3, f64), LoadError> {
            let center = vector(tokens, "the end of a cone")?;
            Ok((center, tokens.number("the radius of a cone")?))
        };
        let (base, tip) = (end()?, end()?);
        let axis = tip.0 - base.0;
        if axis == DVec3::ZERO {
            let what = "a cone has no length; it is left out";
            self.warn(tokens, WarningCode::BadElement, what);
            return Ok(());
        }
        let resolution = self.options.resolution.max(1);
        self.count_triangles(tokens, (resolution as usize).saturating_mul(8))?;
        let ids = self.surface_ids(Surface::NO_TEXTURE);
        let transform = transform(enclosing);
        let draft = self.draft(enclosing, false);
        let is_inside_out = base.1 < 0.0 || tip.1 < 0.0;
        let radii = [base.1.abs(), tip.1.abs()];
        // The axial component of the normals.
        let lean = axis * ((radii[0] - radii[1]) / axis.length_squared());
        let vertices = circle_directions(axis, resolution).flat_map(|outwards| {
            let normal =
                transform.normal((outwards + lean) * if is_inside_out { -1.0 } else { 1.0 });
            let ends = [base.0 + radii[0] * outwards, tip.0 + radii[1] * outwards];
            ends.map(|at| (transform.position(at), normal))
        });
        let vertices = add(draft, tokens, vertices)?;
        for side in 0..vertices.len() / 2 {
            let at = |i: usize| vertices[(2 * side + i) % vertices.len()];
            let [low, high, next_low, next_high] = [0, 1, 2, 3].map(at);
            add_smooth(draft, [low, next_low, next_high], is_inside_out, ids);
            add_smooth(draft, [low, next_high, high], is_inside_out, ids);
        }
        Ok(())
    }

    /// `p`: a polygon without normals.
    pub(super) fn polygon(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        self.any_polygon(tokens, enclosing, false)
    }

    /// `pp`: a polygon with normals.
    pub(super) fn patch(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        self.any_polygon(tokens, enclosing, true)
    }

    fn any_polygon(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
        has_normals: bool,
    ) -> Result<(), LoadError> {
        let count = tokens.count("the number of corners")?;
        if count < 3 {
            let error = tokens.error(format!(
                "a polygon has {count} corners, at least 3 are needed"
            ));
            let what = "a polygon has fewer than three corners; it is left out";
            self.report
                .leave_out(error, tokens.place().1, WarningCode::FewCorners, what)?;
            for _ in 0..count * if has_normals { 2 } else { 1 } {
                vector(tokens, "a corner")?;
            }
            return Ok(());
        }
        let transform = transform(enclosing);
        let (mut corners, mut normals) = (Vec::new(), Vec::new());
        for _ in 0..count {
            corners.push(transform.position(vector(tokens, "a corner")?));
            if has_normals {
                normals.push(transform.normal(vector(tokens, "a normal")?));
            }
        }
        self.count_triangles(tokens, count - 2)?;
        let ids = self.surface_ids(Surface::NO_TEXTURE);
        let draft = self.draft(enclosing, false);
        normals.resize(count, Vec3::ZERO);
        let vertices = corners.iter().copied().zip(normals);
        let vertices = add(draft, tokens, vertices)?;
        let polygon = triangulate(&corners);
        for triangle in polygon.triangles {
            let corners = triangle.map(|corner| vertices[corner]);
            draft.triangle(corners.map(|(vertex, _)| vertex), ids);
            if has_normals {
                draft.set_normals(corners.map(|(_, normal)| normal));
            }
        }
        if let Some(warning) = polygon.warning {
            self.warn(tokens, WarningCode::BadPolygon, warning);
        }
        Ok(())
    }

    /// `tt` and `ttp`: a triangle with a texture.
    pub(super) fn textured_triangle(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
        has_normals: bool,
    ) -> Result<(), LoadError> {
        let texture = tokens.text("the name of a texture")?;
        let texture = self.texture(texture);
        let transform = transform(enclosing);
        let mut vertices = [(DVec3::ZERO, Vec3::ZERO); 3];
        let mut uvs = [[0.0; 2]; 3];
        for ((at, normal), uv) in vertices.iter_mut().zip(&mut uvs) {
            *at = transform.position(vector(tokens, "a corner")?);
            if has_normals {
                *normal = transform.normal(vector(tokens, "a normal")?);
            }
            *uv = tokens.numbers::<2>("a texture coordinate")?.map(narrow);
        }
        self.count_triangles(tokens, 1)?;
        let ids = self.surface_ids(texture);
        let draft = self.draft(enclosing, false);
        let vertices = add(draft, tokens, vertices)?;
        let at = |i: usize| vertices[i];
        draft.triangle([0, 1, 2].map(|i| at(i).0), ids);
        draft.set_uvs(uvs);
        if has_normals {
            draft.set_normals([0, 1, 2].map(|i| at(i).1));
        }
        Ok(())
    }

    /// `m`: an indexed mesh of vertices, optional normals and texture coordinates, and triangles.
    pub(super) fn mesh(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let transform = transform(enclosing);
        tokens.expect("vertices")?;
        let positions = rows(tokens, "vertices", |tokens| vector(tokens, "a vertex"))?;
        let mut normals = None;
        if tokens.take_if("normals") {
            let row = |tokens: &mut Tokens<'_>| Ok(transform.normal(vector(tokens, "a normal")?));
            normals = Some(rows(tokens, "normals", row)?);
        }
        let mut texture = Surface::NO_TEXTURE;
        let mut uvs = None;
        if tokens.take_if("texturecoords") {
            let count = tokens.count("the number of texture coordinates")?;
            let name = tokens.text("the name of a texture")?;
            texture = self.texture(name);
            let mut all = Vec::new();
            for _ in 0..count {
                all.push(tokens.numbers::<2>("a texture coordinate")?.map(narrow));
            }
            uvs = Some(all);
        }
        tokens.expect("triangles")?;
        let ids = self.surface_ids(texture);
        let vertices = {
            let positions = positions
                .iter()
                .map(|at| (transform.position(*at), Vec3::ZERO));
            add(self.draft(enclosing, false), tokens, positions)?
        };
        let triangles = tokens.count("the number of triangles")?;
        // Vertices without triangles take memory too, each time that a file is included.
        let loose = vertices.len().saturating_sub(triangles.saturating_mul(3));
        self.count_triangles(tokens, loose / 3)?;
        for face in 0..triangles {
            self.count_triangles(tokens, 1)?;
            let draft = self.draft(enclosing, false);
            let corners = corners(tokens, face, &vertices)?;
            draft.triangle(corners.map(|(vertex, _)| vertex), ids);
            if let Some(normals) = &normals {
                draft.set_normals(self::corners(tokens, face, normals)?);
            }
            if let Some(uvs) = &uvs {
                draft.set_uvs(self::corners(tokens, face, uvs)?);
            }
        }
        Ok(())
    }

    /// `tpa`: a triangle that morphs between keys.
    pub(super) fn morphing_triangle(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let count = tokens.count("the number of keys")?;
        if count == 0 {
            return Err(tokens.error("a morphing triangle needs at least 1 key"));
        }
        let transform = transform(enclosing);
        let mut keys: Vec<MorphKey> = Vec::new();
        for _ in 0..count {
            keys.push(morph_key(tokens, &transform)?);
        }
        if !keys.is_sorted_by(|a, b| a.time <= b.time) {
            self.warn(tokens, WarningCode::BadAnimation, TIMES_DESCEND);
        }
        self.count_triangles(tokens, 1)?;
        let ids = self.surface_ids(Surface::NO_TEXTURE);
        let draft = self.draft(enclosing, true);
        let first = keys[0]
            .corners
            .map(|corner| (corner.as_dvec3(), Vec3::ZERO));
        let vertices = add(draft, tokens, first)?;
        draft.triangle([0, 1, 2].map(|i| vertices[i].0), ids);
        draft.set_keys(keys);
        Ok(())
    }
}

fn morph_key(tokens: &mut Tokens<'_>, transform: &Transform) -> Result<MorphKey, LoadError> {
    let time = tokens.number("the time of a key")?;
    let (mut corners, mut normals) = ([Vec3::ZERO; 3], [Vec3::ZERO; 3]);
    for (corner, normal) in corners.iter_mut().zip(&mut normals) {
        *corner = transform.position(vector(tokens, "a corner")?).as_vec3();
        *normal = transform.normal(vector(tokens, "a normal")?);
        if !corner.is_finite() {
            return Err(tokens.error("a corner is not finite in f32"));
        }
    }
    Ok(MorphKey {
        time,
        corners,
        normals,
    })
}

/// Reads a count, then that many rows; `what` names the rows in the error.
fn rows<T>(
    tokens: &mut Tokens<'_>,
    what: &str,
    row: impl Fn(&mut Tokens<'_>) -> Result<T, LoadError>,
) -> Result<Vec<T>, LoadError> {
    let count = tokens.count(&format!("the number of {what}"))?;
    // No capacity is reserved for a count that the file only claims.
    let mut all = Vec::new();
    for _ in 0..count {
        all.push(row(tokens)?);
    }
    Ok(all)
}

/// Reads three indices, and returns the elements of `of` that they select.
fn corners<T: Copy>(tokens: &mut Tokens<'_>, face: usize, of: &[T]) -> Result<[T; 3], LoadError> {
    let mut found = [None; 3];
    for corner in &mut found {
        let index = tokens.count("a corner of a triangle")?;
        *corner = of.get(index).copied();
        if corner.is_none() {
            return Err(LoadError::IndexOutOfRange {
                file: tokens.file.to_owned(),
                line: Some(tokens.last_line),
                face,
                index: i64::try_from(index).unwrap_or(i64::MAX),
                vertices: of.len(),
            });
        }
    }
    Ok(found.map(|corner| corner.expect("checked above")))
}

/// Adds vertices, and returns their indices with their normals.
fn add(
    draft: &mut PartDraft,
    tokens: &Tokens<'_>,
    vertices: impl IntoIterator<Item = (DVec3, Vec3)>,
) -> Result<Vec<(u32, Vec3)>, LoadError> {
    let numbered = vertices.into_iter().map(|(at, normal)| {
        let number = draft.vertex(at);
        let number = number.ok_or_else(|| {
            tokens.error("a vertex is not finite in f32, or the part has more than 2^32 vertices")
        })?;
        Ok((number, normal))
    });
    numbered.collect()
}

/// Adds a triangle with vertex normals; `is_flipped` reverses its orientation.
fn add_smooth(draft: &mut PartDraft, corners: [(u32, Vec3); 3], is_flipped: bool, ids: SurfaceIds) {
    let [a, b, c] = corners;
    let corners = if is_flipped { [a, c, b] } else { [a, b, c] };
    draft.triangle(corners.map(|(vertex, _)| vertex), ids);
    draft.set_normals(corners.map(|(_, normal)| normal));
}
