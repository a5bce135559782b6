//! How a tree lies in memory to be traced.

/// How nodes lie in memory when rays are traced. Answers are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Layout {
    /// The tree's own nodes of two children, 8 bytes each: the least memory above its leaves, made soonest, and the
    /// reference.
    Binary,
    /// Nodes of eight children in boxes, all of them tested at once: traces in about half the time. The default.
    #[default]
    Wide,
}
