//! A part under construction, while a scene is read.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use kd_core::{Mesh, MeshError};

use crate::{Deformation, Morph, MorphKey, Part, Surface};

/// How many vertices and triangles a file may have in memory beyond its own size: a short file may repeat its content any number of times.
pub(crate) const MOST_REPEATED: usize = 1 << 26;

/// A part under construction: triangles that move together, and their surface.
#[derive(Debug)]
pub(crate) struct PartDraft {
    name: String,
    node: Option<usize>,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    surface: Surface,
    morph: Option<Morph>,
}

/// Indices of the material and the texture of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceIds {
    pub(crate) material: u32,
    pub(crate) texture: u32,
}

/// The transform from the coordinates of a block or mesh to those of its node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transform {
    to_node: DAffine3,
    /// Transforms normals; the matrix itself if it is singular.
    inverse_transpose: DMat3,
}

impl Transform {
    pub(crate) fn new(to_node: DAffine3) -> Self {
        let determinant = to_node.matrix3.determinant();
        // A singular transform flattens surfaces; their normals have no meaning.
        let inverse_transpose = if determinant == 0.0 {
            to_node.matrix3
        } else {
            to_node.matrix3.inverse().transpose()
        };
        Self {
            to_node,
            inverse_transpose,
        }
    }

    pub(crate) fn position(&self, at: DVec3) -> DVec3 {
        self.to_node.transform_point3(at)
    }

    pub(crate) fn is_mirroring(&self) -> bool {
        self.to_node.matrix3.determinant() < 0.0
    }

    pub(crate) fn vector(&self, vector: DVec3) -> DVec3 {
        self.to_node.transform_vector3(vector)
    }

    /// The change of a transformed normal that a change of the normal makes.
    pub(crate) fn normal_offset(&self, normal: DVec3, offset: DVec3) -> Vec3 {
        // `normal` divides by this length, so that the sum of both keeps its direction.
        let length = (self.inverse_transpose * normal).length();
        let length = if length > 0.0 { length } else { 1.0 };
        (self.inverse_transpose * offset / length).as_vec3()
    }

    pub(crate) fn normal(&self, normal: DVec3) -> Vec3 {
        (self.inverse_transpose * normal)
            .normalize_or_zero()
            .as_vec3()
    }
}

impl PartDraft {
    pub(crate) fn new(name: String, node: Option<usize>, is_morphing: bool) -> Self {
        Self {
            name,
            node,
            positions: Vec::new(),
            triangles: Vec::new(),
            surface: Surface::default(),
            morph: is_morphing.then(Morph::default),
        }
    }

    /// Adds a vertex, in the coordinates of the node, and returns its index. `None` if a coordinate is not finite in `f32`, or
    /// the part has 2^32 vertices.
    pub(crate) fn vertex(&mut self, at: DVec3) -> Option<u32> {
        let at = at.as_vec3();
        let number = u32::try_from(self.positions.len()).ok()?;
        self.positions.push(at.to_array());
        at.is_finite().then_some(number)
    }

    /// Adds a triangle over existing vertices, without normals and texture coordinates.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], ids: SurfaceIds) {
        self.triangles.push(corners);
        self.surface.materials.push(ids.material);
        if ids.texture != Surface::NO_TEXTURE || !self.surface.textures.is_empty() {
            let before = self.triangles.len() - 1;
            self.surface.textures.resize(before, Surface::NO_TEXTURE);
            self.surface.textures.push(ids.texture);
        }
    }

    /// The number of vertices so far.
    pub(crate) fn vertices(&self) -> usize {
        self.positions.len()
    }

    /// The triangles so far.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Sets the normals at the corners of the triangle that was added last.
    pub(crate) fn set_normals(&mut self, normals: [Vec3; 3]) {
        let before = self.triangles.len() - 1;
        self.surface.normals.resize(before, [Vec3::ZERO; 3]);
        self.surface.normals.push(normals);
    }

    /// Sets the texture coordinates at the corners of the triangle that was added last.
    pub(crate) fn set_uvs(&mut self, uvs: [[f32; 2]; 3]) {
        let before = self.triangles.len() - 1;
        self.surface.uvs.resize(before, [[0.0; 2]; 3]);
        self.surface.uvs.push(uvs);
    }

    /// Sets the colors at the corners of the triangle that was added last.
    pub(crate) fn set_colors(&mut self, colors: [Vec3; 3]) {
        let before = self.triangles.len() - 1;
        self.surface.colors.resize(before, [Vec3::ONE; 3]);
        self.surface.colors.push(colors);
    }

    /// Sets the alpha at the corners of the triangle that was added last.
    pub(crate) fn set_alphas(&mut self, alphas: [f32; 3]) {
        let before = self.triangles.len() - 1;
        self.surface.alphas.resize(before, [1.0; 3]);
        self.surface.alphas.push(alphas);
    }

    /// Sets the morph keys of the triangle that was added last.
    pub(crate) fn set_keys(&mut self, keys: Vec<MorphKey>) {
        let morph = self.morph.get_or_insert_default();
        morph.keys.push(keys);
    }

    /// Pads the optional arrays of the surface, and checks the mesh.
    pub(crate) fn finish(mut self) -> Result<Part, MeshError> {
        let triangles = self.triangles.len();
        let surface = &mut self.surface;
        if !surface.textures.is_empty() {
            surface.textures.resize(triangles, Surface::NO_TEXTURE);
        }
        if !surface.normals.is_empty() {
            surface.normals.resize(triangles, [Vec3::ZERO; 3]);
        }
        if !surface.uvs.is_empty() {
            surface.uvs.resize(triangles, [[0.0; 2]; 3]);
        }
        if !surface.colors.is_empty() {
            surface.colors.resize(triangles, [Vec3::ONE; 3]);
        }
        if !surface.alphas.is_empty() {
            surface.alphas.resize(triangles, [1.0; 3]);
        }
        Ok(Part {
            name: self.name,
            node: self.node,
            mesh: Arc::new(Mesh::new(self.positions, self.triangles)?),
            instances: Vec::new(),
            surface: self.surface,
            deformation: self.morph.map(Deformation::Morph),
        })
    }
}
