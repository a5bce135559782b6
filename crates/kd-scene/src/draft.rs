//! The triangles of a part while a scene is read.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use kd_core::{Mesh, MeshError};

use crate::{Deformation, Morph, MorphKey, Part, Surface};

/// Triangles that move together, with what they look like.
#[derive(Debug)]
pub(crate) struct Draft {
    name: String,
    node: Option<usize>,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    surface: Surface,
    morph: Option<Morph>,
}

/// What a triangle looks like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    pub(crate) material: u32,
    pub(crate) texture: u32,
}

/// From the coordinates of a block to those of the node it is in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    to_node: DAffine3,
    /// For normals.
    inverse_transpose: DMat3,
}

impl Place {
    pub(crate) fn new(to_node: DAffine3) -> Self {
        let determinant = to_node.matrix3.determinant();
        // What is flattened has normals in the file that mean nothing any more.
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

    pub(crate) fn normal(&self, normal: DVec3) -> Vec3 {
        (self.inverse_transpose * normal)
            .normalize_or_zero()
            .as_vec3()
    }
}

impl Draft {
    pub(crate) fn new(name: String, node: Option<usize>, morphs: bool) -> Self {
        Self {
            name,
            node,
            positions: Vec::new(),
            triangles: Vec::new(),
            surface: Surface::default(),
            morph: morphs.then(Morph::default),
        }
    }

    /// Adds a vertex, in the coordinates of the node; `None` where they do not fit f32.
    pub(crate) fn vertex(&mut self, at: DVec3) -> Option<u32> {
        let at = at.as_vec3();
        let number = u32::try_from(self.positions.len()).ok()?;
        self.positions.push(at.to_array());
        at.is_finite().then_some(number)
    }

    /// Adds a triangle of vertices that are there, flat and without a texture.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], look: Look) {
        self.triangles.push(corners);
        self.surface.materials.push(look.material);
        if look.texture != Surface::NO_TEXTURE || !self.surface.textures.is_empty() {
            let others = self.triangles.len() - 1;
            self.surface.textures.resize(others, Surface::NO_TEXTURE);
            self.surface.textures.push(look.texture);
        }
    }

    /// Gives the triangle that was added last normals at its corners.
    pub(crate) fn set_normals(&mut self, normals: [Vec3; 3]) {
        let others = self.triangles.len() - 1;
        self.surface.normals.resize(others, [Vec3::ZERO; 3]);
        self.surface.normals.push(normals);
    }

    /// Gives the triangle that was added last places in its texture.
    pub(crate) fn set_uvs(&mut self, uvs: [[f32; 2]; 3]) {
        let others = self.triangles.len() - 1;
        self.surface.uvs.resize(others, [[0.0; 2]; 3]);
        self.surface.uvs.push(uvs);
    }

    /// Gives the triangle that was added last its keys.
    pub(crate) fn set_keys(&mut self, keys: Vec<MorphKey>) {
        let morph = self.morph.get_or_insert_default();
        morph.keys.push(keys);
    }

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
        Ok(Part {
            name: self.name,
            node: self.node,
            mesh: Arc::new(Mesh::new(self.positions, self.triangles)?),
            surface: self.surface,
            deformation: self.morph.map(Deformation::Morph),
        })
    }
}
