//! The triangles of a primitive, and their surface.

use std::rc::Rc;

use glam::{DVec3, Vec3, Vec4};

use super::json::{Attributes, Mesh, Primitive, Whole};
use super::material::Look;
use super::{MeshData, Reader};
use crate::LoadError;
use crate::Surface;
use crate::draft::{PartDraft, SurfaceIds, Transform};
use crate::report::{Place, Report, WarningCode};

/// The vertices and the triangles of a primitive, in the coordinates of its mesh.
pub(super) struct Triangles {
    /// Where the primitive is in the file.
    pointer: String,
    positions: Vec<[f32; 3]>,
    /// Corners, all of which exist.
    triangles: Vec<[u32; 3]>,
    look: Look,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    /// With alpha.
    colors: Option<Vec<Vec4>>,
    /// The morph targets.
    pub(super) targets: Vec<Offsets>,
    /// The joints of each vertex and their weights; empty without any.
    pub(super) influences: Vec<[(u16, f32); 4]>,
}

/// The offsets of a morph target, for each vertex.
pub(super) struct Offsets {
    pub(super) positions: Option<Vec<[f32; 3]>>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
}

/// Attributes that are read, without the number of their set.
const READ: [&str; 7] = [
    "POSITION", "NORMAL", "TEXCOORD", "COLOR", "JOINTS", "WEIGHTS", "TANGENT",
];

impl Reader<'_> {
    /// The triangles of all primitives of a mesh. Those of a mesh that several nodes have are kept.
    pub(super) fn primitives(&mut self, number: Whole) -> Result<Rc<MeshData>, LoadError> {
        if let Some(known) = self.meshes.get(&number.0) {
            return Ok(Rc::clone(known));
        }
        let mesh: Mesh = self.document.get("/meshes", number)?;
        let mut all = Vec::new();
        let mut elements = 0_usize;
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{}/primitives/{index}", number.0);
            match self.primitive(primitive, &pointer) {
                Ok(None) => {}
                Ok(Some(read)) => {
                    elements = elements.saturating_add(read.elements());
                    self.check_count(self.kept.saturating_add(elements), &pointer)?;
                    all.push(read);
                }
                Err(error) => {
                    let what = format!("a primitive cannot be read; it is left out ({error})");
                    let place = Some(Place::Pointer(pointer));
                    self.report
                        .leave_out(error, place, WarningCode::BadElement, &what)?;
                }
            }
        }
        let read = Rc::new((all, mesh.weights));
        if self.uses.get(&number.0).is_some_and(|uses| *uses > 1) {
            self.kept = self.kept.saturating_add(elements);
            self.meshes.insert(number.0, Rc::clone(&read));
        }
        Ok(read)
    }

    /// `None` for points, lines and primitives without positions.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        pointer: &str,
    ) -> Result<Option<Triangles>, LoadError> {
        const DRACO: &str = "KHR_draco_mesh_compression";
        let attributes = &primitive.attributes;
        let Some(positions) = attributes.get("POSITION") else {
            let what = "a primitive has no POSITION; it is left out";
            self.warn(pointer, WarningCode::Unused, what);
            return Ok(None);
        };
        if primitive.extensions.contains_key(DRACO) && !self.has_data(*positions) {
            let problem = format!("is compressed by {DRACO}, which is not supported");
            return Err(self.document.bad_value(pointer, problem));
        }
        let positions = self.numbers::<3>(*positions, false)?;
        let count = positions.len();
        let triangles = self.triangles_of(primitive, count, pointer)?;
        let Some(triangles) = triangles else {
            let what = "points and lines are left out";
            self.warn(pointer, WarningCode::Unused, what);
            return Ok(None);
        };
        let of_targets = count.saturating_mul(primitive.targets.len());
        self.check_count(of_targets, pointer)?;
        let look = self.look(primitive.material);
        let mut read = Triangles {
            pointer: pointer.to_owned(),
            positions,
            triangles,
            look,
            normals: self.of_vertices::<3>(attributes, "NORMAL", false, count, pointer)?,
            uvs: None,
            colors: self.colors(attributes, count, pointer)?,
            targets: Vec::new(),
            influences: Vec::new(),
        };
        if look.texture != Surface::NO_TEXTURE {
            let name = format!("TEXCOORD_{}", look.set);
            let uvs = self.of_vertices::<2>(attributes, &name, true, count, pointer)?;
            if uvs.is_none() {
                let what = format!("the primitive has a texture, but no {name}");
                self.warn(pointer, WarningCode::BadAttribute, what);
            }
            read.uvs = uvs.map(|uvs| uvs.into_iter().map(|uv| look.uv(uv)).collect());
        }
        for (target, attributes) in primitive.targets.iter().enumerate() {
            let pointer = format!("{pointer}/targets/{target}");
            let mut positions =
                self.of_vertices::<3>(attributes, "POSITION", false, count, &pointer)?;
            let mut normals =
                self.of_vertices::<3>(attributes, "NORMAL", false, count, &pointer)?;
            for offsets in [&mut positions, &mut normals] {
                self.check_offsets(offsets.as_deref_mut().unwrap_or_default(), &pointer)?;
            }
            read.targets.push(Offsets { positions, normals });
        }
        read.influences = self.influences(attributes, count, pointer)?;
        self.warn_of_others(attributes, pointer);
        read.drop_unused();
        Ok(Some(read))
    }

    /// Refuses offsets of a morph target that are not finite; a lenient reader replaces them by none.
    fn check_offsets(&mut self, offsets: &mut [[f32; 3]], pointer: &str) -> Result<(), LoadError> {
        for (number, offset) in offsets.iter_mut().enumerate() {
            if offset.iter().all(|coordinate| coordinate.is_finite()) {
                continue;
            }
            let problem = format!("the offset of vertex {number} is not finite");
            let error = self.document.bad_value(pointer, problem);
            let what = "an offset of a morph target is not finite; it is left out";
            let place = Some(Place::Pointer(pointer.to_owned()));
            self.report
                .leave_out(error, place, WarningCode::NotFinite, what)?;
            *offset = [0.0; 3];
        }
        Ok(())
    }

    /// Whether an accessor has values of its own.
    fn has_data(&self, accessor: Whole) -> bool {
        let pointer = format!("/accessors/{}/bufferView", accessor.0);
        self.document.at(&pointer).is_some()
    }

    /// The triangles of a primitive of `count` vertices; `None` for points and lines.
    fn triangles_of(
        &mut self,
        primitive: &Primitive,
        count: usize,
        pointer: &str,
    ) -> Result<Option<Vec<[u32; 3]>>, LoadError> {
        let mode = primitive.mode.map_or(4, |mode| mode.0);
        if mode < 4 {
            return Ok(None);
        }
        let corners: Vec<u32> = match primitive.indices {
            Some(indices) => {
                let indices = self.all_numbers::<u32>(indices, false)?;
                if indices.width != 1 {
                    let pointer = format!("{pointer}/indices");
                    return Err(self
                        .document
                        .bad_value(&pointer, "has more than one number each"));
                }
                indices.numbers
            }
            None => (0..u32::try_from(count).unwrap_or(u32::MAX)).collect(),
        };
        let corner = |i: usize| corners[i];
        let mut triangles: Vec<[u32; 3]> = match mode {
            4 => corners.as_chunks::<3>().0.to_vec(),
            // Every second triangle of a strip is reversed.
            5 => (2..corners.len())
                .map(|i| [corner(i - 2), corner(i - 1 + i % 2), corner(i - i % 2)])
                .collect(),
            6 => (2..corners.len())
                .map(|i| [corner(0), corner(i - 1), corner(i)])
                .collect(),
            other => {
                let problem = format!("the mode {other} is unknown");
                return Err(self.document.bad_value(&format!("{pointer}/mode"), problem));
            }
        };
        if mode == 4 && !corners.len().is_multiple_of(3) {
            let what = format!(
                "{} corners are no whole number of triangles; the last are left out",
                corners.len()
            );
            self.warn(pointer, WarningCode::LeftOver, what);
        }
        let is_there = |corner: &u32| (*corner as usize) < count;
        if corners.iter().all(is_there) {
            return Ok(Some(triangles));
        }
        for triangle in &triangles {
            if let Some(corner) = triangle.iter().find(|corner| !is_there(corner)) {
                let pointer = format!("{pointer}/indices");
                let problem =
                    format!("the index {corner} is out of range, there are {count} vertices");
                let error = self.document.bad_value(&pointer, problem);
                let what = "a triangle has an index out of range; it is left out";
                let place = Some(Place::Pointer(pointer));
                self.report
                    .leave_out(error, place, WarningCode::BadIndex, what)?;
            }
        }
        triangles.retain(|triangle| triangle.iter().all(is_there));
        Ok(Some(triangles))
    }

    /// An attribute of `count` vertices. One with fewer values is left out.
    fn of_vertices<const N: usize>(
        &mut self,
        attributes: &Attributes,
        name: &str,
        is_normalized: bool,
        count: usize,
        pointer: &str,
    ) -> Result<Option<Vec<[f32; N]>>, LoadError> {
        let Some(accessor) = attributes.get(name) else {
            return Ok(None);
        };
        let values = self.numbers::<N>(*accessor, is_normalized)?;
        Ok(self.of_count(values, name, count, pointer))
    }

    /// The values, if there are enough of them.
    fn of_count<T>(
        &mut self,
        mut values: Vec<T>,
        name: &str,
        count: usize,
        pointer: &str,
    ) -> Option<Vec<T>> {
        if values.len() >= count {
            values.truncate(count);
            return Some(values);
        }
        let what = format!(
            "{name} has {} values for {count} vertices; it is not used",
            values.len()
        );
        self.warn(pointer, WarningCode::BadAttribute, what);
        None
    }

    /// The colors of vertices; those without alpha are opaque.
    fn colors(
        &mut self,
        attributes: &Attributes,
        count: usize,
        pointer: &str,
    ) -> Result<Option<Vec<Vec4>>, LoadError> {
        const NAME: &str = "COLOR_0";
        let Some(accessor) = attributes.get(NAME) else {
            return Ok(None);
        };
        let all = self.all_numbers::<f32>(*accessor, true)?;
        if all.width < 3 {
            let what = format!("{NAME} has fewer than three channels; it is not used");
            self.warn(pointer, WarningCode::BadAttribute, what);
            return Ok(None);
        }
        let colors = all.numbers.chunks_exact(all.width);
        let colors = colors.map(|color| {
            let alpha = color.get(3).copied().unwrap_or(1.0);
            let color = Vec3::from_slice(color).extend(alpha);
            color.clamp(Vec4::ZERO, Vec4::ONE)
        });
        let colors = colors.collect();
        Ok(self.of_count(colors, NAME, count, pointer))
    }

    /// The joints and weights of vertices. Vertices without weights do not move.
    fn influences(
        &mut self,
        attributes: &Attributes,
        count: usize,
        pointer: &str,
    ) -> Result<Vec<[(u16, f32); 4]>, LoadError> {
        let joints = self.of_vertices::<4>(attributes, "JOINTS_0", false, count, pointer)?;
        let weights = self.of_vertices::<4>(attributes, "WEIGHTS_0", true, count, pointer)?;
        let (Some(joints), Some(weights)) = (joints, weights) else {
            return Ok(Vec::new());
        };
        let pairs = joints.into_iter().zip(weights).take(count);
        let influences = pairs.map(|(joints, weights)| {
            std::array::from_fn(|i| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "other values saturate and are refused as out of range, or become 0"
                )]
                let joint = joints[i] as u16;
                let weight = weights[i];
                (
                    joint,
                    if weight.is_finite() {
                        weight.max(0.0)
                    } else {
                        0.0
                    },
                )
            })
        });
        Ok(influences.collect())
    }

    /// Names the attributes that are not used. Those of applications begin with `_`, and are for them alone.
    fn warn_of_others(&mut self, attributes: &Attributes, pointer: &str) {
        for name in attributes.keys() {
            let (kind, set) = name.rsplit_once('_').unwrap_or((name, "0"));
            let is_first = set == "0" || kind == "TEXCOORD";
            if name.starts_with('_') || (READ.contains(&kind) && is_first) {
                continue;
            }
            let what = format!("the attribute {name} is not used");
            self.warn(pointer, WarningCode::Unused, what);
        }
    }
}

impl Triangles {
    /// The number of vertices, of triangles, and of offsets in all targets.
    pub(super) fn elements(&self) -> usize {
        let vertices = self.positions.len();
        let of_targets = vertices.saturating_mul(self.targets.len());
        of_targets.saturating_add(vertices + self.triangles.len())
    }

    /// Drops the vertices that no triangle uses: the primitives of a mesh often share those of all.
    fn drop_unused(&mut self) {
        const UNUSED: u32 = u32::MAX;
        let mut numbers = vec![UNUSED; self.positions.len()];
        for corner in self.triangles.iter().flatten() {
            numbers[*corner as usize] = 0;
        }
        if !numbers.contains(&UNUSED) {
            return;
        }
        let used = numbers.iter_mut().filter(|number| **number != UNUSED);
        for (number, next) in used.zip(0..) {
            *number = next;
        }
        for corner in self.triangles.iter_mut().flatten() {
            *corner = numbers[*corner as usize];
        }
        fn keep<T>(all: &mut Vec<T>, numbers: &[u32]) {
            let mut numbers = numbers.iter();
            all.retain(|_| numbers.next().is_some_and(|number| *number != u32::MAX));
        }
        keep(&mut self.positions, &numbers);
        keep(&mut self.influences, &numbers);
        let vectors = [&mut self.normals].into_iter();
        let of_targets = self
            .targets
            .iter_mut()
            .flat_map(|target| [&mut target.positions, &mut target.normals]);
        vectors
            .chain(of_targets)
            .flatten()
            .for_each(|all| keep(all, &numbers));
        if let Some(uvs) = &mut self.uvs {
            keep(uvs, &numbers);
        }
        if let Some(colors) = &mut self.colors {
            keep(colors, &numbers);
        }
    }

    /// The same with the morph targets, each with its weight, added to positions and normals.
    pub(super) fn blended(&self, weights: &[f64]) -> Self {
        let add = |to: &mut [[f32; 3]], offsets: &[[f32; 3]], weight: f64| {
            for (to, offset) in to.iter_mut().zip(offsets) {
                let [at, offset] = [*to, *offset].map(|it| Vec3::from(it).as_dvec3());
                *to = (at + weight * offset).as_vec3().to_array();
            }
        };
        let mut blended = Self {
            pointer: self.pointer.clone(),
            positions: self.positions.clone(),
            triangles: self.triangles.clone(),
            normals: self.normals.clone(),
            uvs: self.uvs.clone(),
            colors: self.colors.clone(),
            influences: self.influences.clone(),
            targets: Vec::new(),
            ..*self
        };
        for (target, weight) in self.targets.iter().zip(weights) {
            if let Some(offsets) = &target.positions {
                add(&mut blended.positions, offsets, *weight);
            }
            if let (Some(normals), Some(offsets)) = (&mut blended.normals, &target.normals) {
                add(normals, offsets, *weight);
            }
        }
        blended
    }

    /// Adds the triangles to a part, and returns the indices there of all vertices. Mirrored ones have the reverse order of corners.
    pub(super) fn add_to(
        &self,
        draft: &mut PartDraft,
        transform: &Transform,
        is_mirrored: bool,
        file: &str,
        report: &mut Report,
    ) -> Result<Vec<u32>, LoadError> {
        let mut vertices = Vec::with_capacity(self.positions.len());
        let mut not_finite = Vec::new();
        let placed = |position: &[f32; 3]| transform.position(Vec3::from(*position).as_dvec3());
        let is_finite = |at: &DVec3| at.as_vec3().is_finite();
        let mut first_finite = self.positions.iter().map(placed).filter(is_finite);
        // No triangle uses a replaced vertex: in the place of another one it changes no box.
        let replacement = first_finite.next().unwrap_or_default();
        for (number, position) in self.positions.iter().enumerate() {
            let mut at = placed(position);
            if !is_finite(&at) {
                let pointer = format!("{}/attributes/POSITION", self.pointer);
                let error = LoadError::BadValue {
                    file: file.to_owned(),
                    pointer: pointer.clone(),
                    problem: format!("vertex {number} is not finite in f32"),
                };
                let what = "a vertex is not finite; it is left out";
                let place = Some(Place::Pointer(pointer));
                report.leave_out(error, place, WarningCode::NotFinite, what)?;
                not_finite.push(number);
                at = replacement;
            }
            let vertex = draft.vertex(at).ok_or_else(|| LoadError::BadValue {
                file: file.to_owned(),
                pointer: self.pointer.clone(),
                problem: "the part has more than 2^32 vertices".to_owned(),
            })?;
            vertices.push(vertex);
        }
        let ids = SurfaceIds {
            material: self.look.material,
            texture: match self.uvs {
                Some(_) => self.look.texture,
                None => Surface::NO_TEXTURE,
            },
        };
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| corner as usize);
            let at = if is_mirrored { [a, c, b] } else { [a, b, c] };
            if !not_finite.is_empty()
                && at
                    .iter()
                    .any(|corner| not_finite.binary_search(corner).is_ok())
            {
                let what = "a triangle uses a vertex that is not finite; it is left out";
                let place = Some(Place::Pointer(self.pointer.clone()));
                report.warn(file, place, WarningCode::NotFinite, what);
                continue;
            }
            draft.triangle(at.map(|corner| vertices[corner]), ids);
            if let Some(normals) = &self.normals {
                let normal =
                    |corner: usize| transform.normal(Vec3::from(normals[corner]).as_dvec3());
                draft.set_normals(at.map(normal));
            }
            if let Some(uvs) = &self.uvs {
                draft.set_uvs(at.map(|corner| uvs[corner]));
            }
            if let Some(colors) = &self.colors {
                draft.set_colors(at.map(|corner| colors[corner].truncate()));
                if self.look.has_alpha {
                    draft.set_alphas(at.map(|corner| colors[corner].w));
                }
            }
        }
        Ok(vertices)
    }
}
