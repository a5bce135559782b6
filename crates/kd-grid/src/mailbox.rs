//! Avoids tests of a triangle that several cells hold.

/// The triangles that a ray was tested against last.
///
/// Instead of a mark on each triangle, which threads would share, a ray keeps a few numbers (inverse mailboxes; M. Shevtsov,
/// A. Soupikov, A. Kapustin, *Ray-Triangle Intersection Algorithm for Modern CPU Architectures*, 2007). A forgotten triangle is
/// tested again, with the same result.
pub(crate) struct Mailbox([u32; PLACES]);

const PLACES: usize = 16;

impl Mailbox {
    pub(crate) fn new() -> Self {
        Self([u32::MAX; PLACES])
    }

    /// Remembers a triangle. Returns whether it was not remembered before.
    #[inline]
    pub(crate) fn is_new(&mut self, triangle: u32) -> bool {
        let place = &mut self.0[triangle as usize % PLACES];
        std::mem::replace(place, triangle) != triangle
    }
}
