//! What a commit has done.

use std::fmt;

use kd_core::LayoutBytes;

use super::{PartId, Strategy};

/// What a commit has done, and why.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct CommitReport {
    /// The scene's strategy.
    pub strategy: Strategy,
    /// Number of parts in the frame.
    pub parts: usize,
    /// Triangles of all parts.
    pub triangles: usize,
    /// The parts that were built, refitted or moved. Other parts are unchanged.
    pub changes: Vec<PartChange>,
    /// Nodes that join the parts.
    pub top_nodes: usize,
    /// Subtrees of parts that these nodes refer to, shared with the frame before where the part has not changed.
    pub links: usize,
    /// Nodes of parts that rays skip, since their children were joined with those of parts that overlap.
    pub opened: usize,
    /// Bytes of the frame's layout.
    pub bytes: LayoutBytes,
}

/// What a commit has done with one part.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct PartChange {
    /// The part.
    pub part: PartId,
    /// Number of its triangles.
    pub triangles: usize,
    /// What was done.
    pub action: CommitAction,
    /// Why it was done.
    pub reason: CommitReason,
}

/// What a commit can do with a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CommitAction {
    /// Built with the options of the scene.
    Built,
    /// Built with a fast builder.
    BuiltFast,
    /// Its boxes were refitted to its triangles.
    Refitted,
    /// Its kd-tree was translated, or scaled along the axes, as the part was.
    Moved,
    /// Its triangles were inserted one by one into the kd-tree of the static parts.
    Inserted,
    /// Built in one tree with all other parts.
    BuiltWithAll,
    /// Placed: it shares one tree with other parts of the same mesh.
    Shared,
}

/// Why a commit did something with a part.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CommitReason {
    /// The frame before had no nodes of the part that this strategy could use.
    New,
    /// The strategy does so with every part that has changed.
    Strategy,
    /// [`Strategy::Auto`] compared the time that the rays of a frame lose to boxes that no longer fit with the time of a build.
    Estimate {
        /// Time that rays lose, in nanoseconds.
        ray_loss_ns: f64,
        /// Time by which building exceeds refitting, in nanoseconds.
        build_ns: f64,
    },
    /// [`Strategy::Auto`] compared the memory and the time of copies of a mesh with the time that the rays of a frame lose where
    /// parts share one tree.
    Sharing {
        /// Bytes of copies for all parts of the mesh.
        copied_bytes: f64,
        /// Time to make the copies of the parts that have changed, in nanoseconds.
        copy_ns: f64,
        /// Time that rays lose in these parts, in nanoseconds.
        ray_loss_ns: f64,
    },
}

impl fmt::Display for CommitReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} parts, {} triangles; {} nodes over {} subtrees, {} opened",
            self.parts, self.triangles, self.top_nodes, self.links, self.opened
        )?;
        for change in &self.changes {
            writeln!(f, "{change}")?;
        }
        Ok(())
    }
}

impl fmt::Display for PartChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let done = match self.action {
            CommitAction::Built => "built",
            CommitAction::BuiltFast => "built fast",
            CommitAction::Refitted => "refitted",
            CommitAction::Moved => "moved with its tree",
            CommitAction::Inserted => "inserted",
            CommitAction::BuiltWithAll => "built with all others",
            CommitAction::Shared => "shares a tree",
        };
        write!(f, "{}, {} triangles: {done}, ", self.part, self.triangles)?;
        match &self.reason {
            CommitReason::New => f.write_str("new"),
            CommitReason::Strategy => f.write_str("by the strategy"),
            CommitReason::Estimate {
                ray_loss_ns,
                build_ns,
            } => write!(
                f,
                "rays lose {:.3} ms, a build takes {:.3} ms",
                ray_loss_ns * 1e-6,
                build_ns * 1e-6
            ),
            CommitReason::Sharing {
                copied_bytes,
                copy_ns,
                ray_loss_ns,
            } => write!(
                f,
                "copies take {:.0} MB and {:.3} ms, rays lose {:.3} ms",
                copied_bytes * 1e-6,
                copy_ns * 1e-6,
                ray_loss_ns * 1e-6
            ),
        }
    }
}
