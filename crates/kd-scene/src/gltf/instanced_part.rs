//! Parts that have several instances, whose triangles are in memory once.

use glam::{DAffine3, DVec3};
use kd_core::Aabb;

use super::json::Node;
use super::primitive::Triangles;
use super::{Enclosing, Reader, elements, instances};
use crate::LoadError;
use crate::description::mirrors;
use crate::draft::{PartDraft, Transform};
use crate::report::{Place, WarningCode};

/// Vertices that take the memory of an instance: 12 bytes each, and 96 bytes.
const OF_INSTANCE: usize = 8;

impl Reader<'_> {
    /// Adds the mesh of a node as a part with instances, given their transforms to the coordinates of the node.
    pub(super) fn instanced_part(
        &mut self,
        node: &Node,
        pointer: &str,
        enclosing: Enclosing,
        primitives: &[Triangles],
        instances: Vec<DAffine3>,
    ) -> Result<(), LoadError> {
        let elements = elements(primitives);
        self.count(elements, pointer)?;
        let mut draft = PartDraft::new(node.name.clone(), enclosing.moving_node, false);
        // An instance reverses the order of corners where its own transform mirrors.
        let is_mirrored = enclosing.is_mirrored ^ mirrors(&enclosing.to_moving_node);
        let transform = Transform::new(DAffine3::IDENTITY);
        for primitive in primitives {
            let (file, report) = (self.file, &mut *self.report);
            primitive.add_to(&mut draft, &transform, is_mirrored, file, report)?;
        }
        let mut part = draft.finish().map_err(|source| LoadError::Mesh {
            file: self.file.to_owned(),
            source,
        })?;
        let bounds = part.mesh.bounds();
        for (number, instance) in instances.into_iter().enumerate() {
            let instance = enclosing.to_moving_node * instance;
            let size = Size::of(&bounds, &instance);
            if size == Size::NotFinite {
                self.leave_out_instance(number, pointer)?;
                continue;
            }
            let of_copy = if size == Size::Copied { elements } else { 0 };
            self.count(of_copy.saturating_add(OF_INSTANCE), pointer)?;
            part.instances.push(instance);
        }
        // Without any, the part itself would be there.
        if !part.instances.is_empty() {
            self.instanced_parts.push(part);
        }
        Ok(())
    }

    /// Refuses an instance whose vertices are not finite; a lenient reader leaves it out.
    fn leave_out_instance(&mut self, number: usize, pointer: &str) -> Result<(), LoadError> {
        let pointer = format!("{pointer}/extensions/{}/attributes", instances::NAME);
        let problem = format!("instance {number} is not finite in f32");
        let error = self.document.bad_value(&pointer, problem);
        let what = "an instance is not finite; it is left out";
        let place = Some(Place::Pointer(pointer));
        self.report
            .leave_out(error, place, WarningCode::NotFinite, what)
    }
}

/// What an instance takes in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Size {
    /// A transform.
    Placed,
    /// A copy of the mesh: rays cannot be transformed to its coordinates, since the instance is flat, or tiny and far away.
    Copied,
    /// Coordinates overflow f32.
    NotFinite,
}

impl Size {
    fn of(bounds: &Aabb, instance: &DAffine3) -> Self {
        /// Rays in the coordinates of the mesh err by 2⁻²¹ of this, and may err by 2⁻⁴ of the side of the mesh.
        const MOST: f64 = (1 << 16) as f64;
        if bounds.is_empty() {
            return Self::Placed;
        }
        let most = bounds.min.abs().max(bounds.max.abs()).as_dvec3();
        let reach = sizes(instance, most) + instance.translation.abs();
        if !reach.cmplt(DVec3::splat(f32::MAX.into())).all() {
            return Self::NotFinite;
        }
        let inverse = DAffine3::from_mat3(instance.matrix3.inverse());
        let local = sizes(&inverse, reach).max_element();
        if local < MOST * f64::from(bounds.extent().max_element()) {
            Self::Placed
        } else {
            Self::Copied
        }
    }
}

/// The largest coordinates of a transformed vector whose coordinates have at most these magnitudes.
fn sizes(transform: &DAffine3, most: DVec3) -> DVec3 {
    let columns = transform.matrix3.to_cols_array_2d().map(DVec3::from);
    let [x, y, z] = columns.map(DVec3::abs);
    x * most.x + y * most.y + z * most.z
}
