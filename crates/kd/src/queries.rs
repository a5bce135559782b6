//! The queries of [`RayQuery`](crate::RayQuery) that are made of others, as methods of the types that answer, so that the trait need
//! not be in scope.

/// Methods for an `impl` block of a type that implements [`RayQuery`](crate::RayQuery) with hits of this type.
macro_rules! made_queries {
    ($hit:ty) => {
        /// As [`RayQuery::count_hits`](crate::RayQuery::count_hits).
        pub fn count_hits(&self, ray: &$crate::Ray) -> usize {
            $crate::RayQuery::count_hits(self, ray)
        }

        /// As [`RayQuery::each_hit`](crate::RayQuery::each_hit).
        pub fn each_hit(&self, ray: &$crate::Ray) -> $crate::query::EachHit<'_, Self> {
            $crate::RayQuery::each_hit(self, ray)
        }

        /// As [`RayQuery::intersect_filtered`](crate::RayQuery::intersect_filtered).
        pub fn intersect_filtered(
            &self,
            ray: &$crate::Ray,
            filter: impl FnMut(&$hit) -> $crate::Verdict,
        ) -> Option<$hit> {
            $crate::RayQuery::intersect_filtered(self, ray, filter)
        }

        /// As [`RayQuery::occluded_filtered`](crate::RayQuery::occluded_filtered).
        pub fn occluded_filtered(
            &self,
            ray: &$crate::Ray,
            filter: impl FnMut(&$hit) -> $crate::Verdict,
        ) -> bool {
            $crate::RayQuery::occluded_filtered(self, ray, filter)
        }

        /// As [`RayQuery::hits_filtered`](crate::RayQuery::hits_filtered).
        pub fn hits_filtered(
            &self,
            ray: &$crate::Ray,
            max: usize,
            out: &mut Vec<$hit>,
            filter: impl FnMut(&$hit) -> $crate::Verdict,
        ) {
            $crate::RayQuery::hits_filtered(self, ray, max, out, filter);
        }

        /// As [`RayQuery::intersect_filtered_batch`](crate::RayQuery::intersect_filtered_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn intersect_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            hits: &mut [Option<$hit>],
            filter: impl FnMut(usize, &$hit) -> $crate::Verdict,
        ) {
            $crate::RayQuery::intersect_filtered_batch(self, rays, hits, filter);
        }

        /// As [`RayQuery::occluded_filtered_batch`](crate::RayQuery::occluded_filtered_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn occluded_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            occluded: &mut [bool],
            filter: impl FnMut(usize, &$hit) -> $crate::Verdict,
        ) {
            $crate::RayQuery::occluded_filtered_batch(self, rays, occluded, filter);
        }

        /// As [`RayQuery::hits_filtered_batch`](crate::RayQuery::hits_filtered_batch).
        pub fn hits_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            max: usize,
            filter: impl FnMut(usize, &$hit) -> $crate::Verdict,
        ) -> $crate::HitLists<$hit> {
            $crate::RayQuery::hits_filtered_batch(self, rays, max, filter)
        }

        /// As [`RayQuery::hits_batch`](crate::RayQuery::hits_batch).
        pub fn hits_batch(&self, rays: &[$crate::Ray], max: usize) -> $crate::HitLists<$hit> {
            $crate::RayQuery::hits_batch(self, rays, max)
        }

        /// As [`RayQuery::count_hits_batch`](crate::RayQuery::count_hits_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn count_hits_batch(&self, rays: &[$crate::Ray], counts: &mut [usize]) {
            $crate::RayQuery::count_hits_batch(self, rays, counts);
        }

        /// As [`RayQuery::par_intersect_batch`](crate::RayQuery::par_intersect_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn par_intersect_batch(&self, rays: &[$crate::Ray], hits: &mut [Option<$hit>]) {
            $crate::RayQuery::par_intersect_batch(self, rays, hits);
        }

        /// As [`RayQuery::par_occluded_batch`](crate::RayQuery::par_occluded_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn par_occluded_batch(&self, rays: &[$crate::Ray], occluded: &mut [bool]) {
            $crate::RayQuery::par_occluded_batch(self, rays, occluded);
        }

        /// As [`RayQuery::par_hits_batch`](crate::RayQuery::par_hits_batch).
        pub fn par_hits_batch(&self, rays: &[$crate::Ray], max: usize) -> $crate::HitLists<$hit> {
            $crate::RayQuery::par_hits_batch(self, rays, max)
        }

        /// As [`RayQuery::par_count_hits_batch`](crate::RayQuery::par_count_hits_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn par_count_hits_batch(&self, rays: &[$crate::Ray], counts: &mut [usize]) {
            $crate::RayQuery::par_count_hits_batch(self, rays, counts);
        }

        /// As [`RayQuery::par_intersect_filtered_batch`](crate::RayQuery::par_intersect_filtered_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn par_intersect_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            hits: &mut [Option<$hit>],
            filter: impl Fn(usize, &$hit) -> $crate::Verdict + Sync + Send,
        ) {
            $crate::RayQuery::par_intersect_filtered_batch(self, rays, hits, filter);
        }

        /// As [`RayQuery::par_occluded_filtered_batch`](crate::RayQuery::par_occluded_filtered_batch).
        ///
        /// # Panics
        ///
        /// If the slices differ in length.
        pub fn par_occluded_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            occluded: &mut [bool],
            filter: impl Fn(usize, &$hit) -> $crate::Verdict + Sync + Send,
        ) {
            $crate::RayQuery::par_occluded_filtered_batch(self, rays, occluded, filter);
        }

        /// As [`RayQuery::par_hits_filtered_batch`](crate::RayQuery::par_hits_filtered_batch).
        pub fn par_hits_filtered_batch(
            &self,
            rays: &[$crate::Ray],
            max: usize,
            filter: impl Fn(usize, &$hit) -> $crate::Verdict + Sync + Send,
        ) -> $crate::HitLists<$hit> {
            $crate::RayQuery::par_hits_filtered_batch(self, rays, max, filter)
        }
    };
}

/// The queries that are made of others.
impl crate::KdTree {
    made_queries!(crate::Hit);
}

/// The queries that are made of others.
impl crate::LazyTree {
    made_queries!(crate::Hit);
}

/// The queries that are made of others.
impl crate::Accel {
    made_queries!(crate::Hit);
}

/// The queries that are made of others.
impl crate::FrameData {
    made_queries!((crate::PartId, crate::Hit));
}
