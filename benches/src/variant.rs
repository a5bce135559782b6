//! From a name to a structure.

use std::sync::Arc;

use anyhow::Context as _;
use kd::Mesh;

use crate::names::{LayoutName, StructureName, Variant};
use crate::structure::Built;
use crate::{ours, peers};

impl Variant {
    /// Builds the structure, ours or a rival's.
    pub(crate) fn build(self, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
        // No builder of a kd-tree is a rival's, also those that share a name.
        let built = if self.is_rival() && self.structure != StructureName::Kd {
            peers::build(self, mesh, threads)
        } else {
            ours::build(self, mesh, threads)
        };
        built.with_context(|| format!("cannot build {self}"))
    }

    /// Seconds of one build.
    pub(crate) fn build_seconds(self, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<f64> {
        if self.layout == LayoutName::Tree {
            return ours::tree_seconds(self.builder, mesh, threads);
        }
        Ok(self.build(mesh, threads)?.seconds)
    }
}
