//! Not testing a triangle again that lies in several cells.

/// The triangles that a ray was tested against lately.
///
/// Instead of a mark on each triangle, which threads would have to share, a ray keeps a few numbers (inverse mailboxes;
/// M. Shevtsov, A. Soupikov, A. Kapustin, *Ray-Triangle Intersection Algorithm for Modern CPU Architectures*, 2007). One that
/// is forgotten is tested again, which does no harm.
pub(crate) struct Mailbox([u32; PLACES]);

const PLACES: usize = 16;

impl Mailbox {
    pub(crate) fn new() -> Self {
        Self([u32::MAX; PLACES])
    }

    /// Whether the triangle is not among those that are remembered. Now it is.
    #[inline]
    pub(crate) fn is_new(&mut self, triangle: u32) -> bool {
        let place = &mut self.0[triangle as usize % PLACES];
        std::mem::replace(place, triangle) != triangle
    }
}
