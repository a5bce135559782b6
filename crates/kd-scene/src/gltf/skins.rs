//! Parts that change their shape: meshes with skins or with animated morph targets.

use std::collections::HashMap;

use glam::{DAffine3, DMat4, Vec3};

use super::json::{self, Node, Whole};
use super::primitive::{Offsets, Triangles};
use super::{Enclosing, Reader, vector};
use crate::draft::{PartDraft, Transform};
use crate::keys::sampled::Sampled;
use crate::{Deformation, LoadError, MorphTargets, Part, Skin};

/// A part of the mesh of one node, before the indices of its joints are known.
pub(super) struct OwnPart {
    /// The node in the file.
    node: Whole,
    skin: Option<Whole>,
    part: Part,
    influences: Vec<[(u16, f32); 4]>,
    offsets: Vec<Vec<Vec3>>,
    normals: Vec<Vec<[Vec3; 3]>>,
}

impl Reader<'_> {
    /// Adds the mesh of a node as a part of its own.
    pub(super) fn own_part(
        &mut self,
        node: &Node,
        number: Whole,
        enclosing: Enclosing,
        primitives: &[Triangles],
    ) -> Result<(), LoadError> {
        // The joints of a skin place it, whatever its node is.
        let (of_node, transform) = match node.skin {
            Some(_) => (None, DAffine3::IDENTITY),
            None => (enclosing.moving_node, enclosing.to_moving_node),
        };
        let transform = Transform::new(transform);
        let mut draft = PartDraft::new(node.name.clone(), of_node, false);
        let targets = primitives.iter().map(|primitive| primitive.targets.len());
        let targets = targets.max().unwrap_or(0);
        let (mut offsets, mut normals) = (vec![Vec::new(); targets], vec![Vec::new(); targets]);
        let mut influences = Vec::new();
        for primitive in primitives {
            let (before, first) = (draft.triangles().len(), draft.vertices());
            let is_mirrored = enclosing.is_mirrored && node.skin.is_none();
            let (file, report) = (self.file, &mut *self.report);
            let vertices = primitive.add_to(&mut draft, &transform, is_mirrored, file, report)?;
            let end = first + vertices.len();
            influences.extend_from_slice(&primitive.influences);
            influences.resize(end, [(0, 0.0); 4]);
            for (number, (offsets, normals)) in offsets.iter_mut().zip(&mut normals).enumerate() {
                let Some(target) = primitive.targets.get(number) else {
                    continue;
                };
                let triangles = &draft.triangles()[before..];
                add_offsets(target, &transform, first, offsets);
                if let (Some(base), Some(of_target)) = (&primitive.normals, &target.normals) {
                    let corners = triangles
                        .iter()
                        .map(|corners| corners.map(|it| it as usize - first));
                    let offset = |corner: usize| {
                        let [base, offset] = [base[corner], of_target[corner]];
                        transform.normal_offset(vector(base), vector(offset))
                    };
                    normals.resize(before, [Vec3::ZERO; 3]);
                    normals.extend(corners.map(|corners| corners.map(offset)));
                }
            }
        }
        let part = draft.finish().map_err(|source| LoadError::Mesh {
            file: self.file.to_owned(),
            source,
        })?;
        self.own_parts.push(OwnPart {
            node: number,
            skin: node.skin,
            part,
            influences,
            offsets,
            normals,
        });
        Ok(())
    }

    /// Adds all such parts to the scene. `weights` are the curves of morph targets by node of the file.
    pub(super) fn finish_own_parts(
        &mut self,
        weights: &HashMap<usize, Vec<Sampled<f64>>>,
    ) -> Result<(), LoadError> {
        for own in std::mem::take(&mut self.own_parts) {
            let skin = own.skin.map(|skin| self.skin(skin, own.influences));
            let skin = skin.transpose()?;
            let mut part = own.part;
            part.deformation = match weights.get(&own.node.0) {
                Some(weights) => Some(Deformation::Targets(MorphTargets {
                    offsets: own.offsets,
                    normals: own.normals,
                    weights: weights.clone(),
                    skin,
                })),
                None => skin.map(Deformation::Skin),
            };
            self.scene.parts.push(part);
        }
        Ok(())
    }

    fn skin(&mut self, number: Whole, influences: Vec<[(u16, f32); 4]>) -> Result<Skin, LoadError> {
        const SKINS: &str = "/skins";
        let skin: json::Skin = self.document.get(SKINS, number)?;
        let bad = |problem: String| {
            self.document
                .bad_value(&format!("{SKINS}/{}", number.0), problem)
        };
        let mut joints = Vec::new();
        for joint in &skin.joints {
            let node = self.node_index.get(&joint.0).copied();
            joints.push(
                node.ok_or_else(|| bad(format!("the joint {} is not in the scene", joint.0)))?,
            );
        }
        let weighted = influences
            .iter()
            .flatten()
            .filter(|(_, weight)| *weight > 0.0);
        let last = weighted.map(|(joint, _)| usize::from(*joint)).max();
        if let Some(last) = last.filter(|last| *last >= joints.len()) {
            let problem = format!("a vertex has the joint {last}, there are {}", joints.len());
            return Err(bad(problem));
        }
        // Each node of a skin has a copy of its own, which takes about as much as eight vertices.
        let copied = skin.joints.len().saturating_mul(8);
        self.count(copied, &format!("{SKINS}/{}", number.0))?;
        let matrices = skin
            .inverse_bind_matrices
            .map(|matrices| self.numbers::<16>(matrices, false));
        let matrices = matrices.transpose()?.unwrap_or_default().into_iter();
        let mut inverse_binds: Vec<DAffine3> = matrices
            .map(|matrix| DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))))
            .collect();
        inverse_binds.resize(joints.len(), DAffine3::IDENTITY);
        Ok(Skin {
            joints,
            inverse_binds,
            influences,
        })
    }
}

/// Adds the offsets of the vertices from `first` on in a target, if it has any.
fn add_offsets(target: &Offsets, transform: &Transform, first: usize, to: &mut Vec<Vec3>) {
    if let Some(offsets) = &target.positions {
        to.resize(first, Vec3::ZERO);
        let moved = |offset: &[f32; 3]| transform.vector(vector(*offset)).as_vec3();
        to.extend(offsets.iter().map(moved));
    }
}
