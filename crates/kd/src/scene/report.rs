//! What a commit has done.

use std::fmt;

use kd_core::TracedBytes;

use super::{PartId, Strategy};

/// What a commit has done, and why.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CommitReport {
    /// What was asked for.
    pub strategy: Strategy,
    /// Parts and triangles of the frame.
    pub parts: usize,
    /// Triangles of all parts.
    pub triangles: usize,
    /// The parts that have changed, or had to be made for another reason. Other parts were not touched.
    pub changes: Vec<PartChange>,
    /// Nodes that join the parts.
    pub top_nodes: usize,
    /// Subtrees of parts that those refer to, shared with the frame before where the part has not changed.
    pub links: usize,
    /// Nodes of parts that are not traced, since what is below them was joined with what it overlaps with.
    pub opened: usize,
    /// Bytes that rays of this frame may read.
    pub bytes: TracedBytes,
}

/// What was done with a part.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PartChange {
    /// The part.
    pub part: PartId,
    /// How many triangles it has.
    pub triangles: usize,
    /// What was done.
    pub action: Action,
    /// Why that.
    pub reason: Reason,
}

/// What can be done with a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Action {
    /// Built with the options of the scene.
    Built,
    /// Built with a fast builder.
    BuiltFast,
    /// Boxes were fitted to where its triangles are.
    Refitted,
    /// Its kd-tree was moved, since it only moved on along its course: translated, or scaled along the axes.
    Moved,
    /// Sent down the kd-tree of what stands still, triangle by triangle.
    Inserted,
    /// Built anew together with all others.
    BuiltWithAll,
}

/// Why something was done.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reason {
    /// There was nothing of it that this strategy could use.
    New,
    /// The strategy does so with whatever has changed.
    Strategy,
    /// What the rays of a frame lose to boxes that no longer fit, in nanoseconds by [`Strategy::Auto`]'s reckoning, is more
    /// or less than what it takes to build the part anew.
    Reckoned {
        /// What rays lose.
        rays_lose_ns: f64,
        /// What building takes, over refitting.
        building_takes_ns: f64,
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
            Action::Built => "built",
            Action::BuiltFast => "built fast",
            Action::Refitted => "refitted",
            Action::Moved => "moved with its tree",
            Action::Inserted => "inserted",
            Action::BuiltWithAll => "built with all others",
        };
        write!(f, "{}, {} triangles: {done}, ", self.part, self.triangles)?;
        match &self.reason {
            Reason::New => f.write_str("new"),
            Reason::Strategy => f.write_str("as the strategy says"),
            Reason::Reckoned {
                rays_lose_ns,
                building_takes_ns,
            } => write!(
                f,
                "rays lose {:.3} ms and building takes {:.3} ms",
                rays_lose_ns * 1e-6,
                building_takes_ns * 1e-6
            ),
        }
    }
}
