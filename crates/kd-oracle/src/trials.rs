//! The tests that every structure passes: meshes and rays that are hard in different ways, compared with brute force.
//!
//! [`trials!`](crate::trials!) makes a test of each trial, so that a trial added here tests every structure.

mod meshes;
mod rays;

pub use meshes::*;
pub use rays::*;

use std::fmt;
use std::sync::Arc;

use kd_core::{Hit, Mesh, Ray};
use kd_trace::{RayQuery, brute_force};

use crate::check::{check, check_batch, source};
use crate::effort;
use crate::rays::Rays;

/// A structure under test.
pub struct Structure<'a> {
    /// Its queries.
    pub query: Box<dyn RayQuery<Hit = Hit> + Sync + 'a>,
    /// Axis and position of planes that the structure divides space by: some rays begin or run in them. May be empty.
    pub planes: Vec<(usize, f32)>,
}

impl<'a> Structure<'a> {
    /// A structure and its planes.
    pub fn new(query: impl RayQuery<Hit = Hit> + Sync + 'a, planes: Vec<(usize, f32)>) -> Self {
        Self {
            query: Box::new(query),
            planes,
        }
    }
}

impl fmt::Debug for Structure<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let planes = self.planes.len();
        f.debug_struct("Structure")
            .field("planes", &planes)
            .finish_non_exhaustive()
    }
}

/// Builds structures of one kind, with different options, over a mesh.
pub type Build = for<'a> fn(&'a Arc<Mesh>) -> Vec<Structure<'a>>;

/// The structures of a trial, and its size.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    /// Builds the structures.
    pub build: Build,
    /// Number of random rays around each mesh with the feature `long-tests`; a tenth of it without, but at least a hundred; a fifth of that for each of
    /// several scales.
    pub rays: usize,
    /// Number of points in each closed mesh from which rays are aimed at all edges; at most two without `long-tests`.
    pub points: usize,
}

/// A trial.
pub type Trial = fn(&Subject);

/// Makes a test of every trial, under its name: `run` is a function of the name and the [`Trial`].
#[macro_export]
macro_rules! trials {
    ($run:path) => {
        $crate::trials! {
            $run:
            a_hit_beside_its_triangle,
            along_an_axis_and_past_its_end,
            as_many_hits_as_asked_for,
            batches_and_packets_answer_as_single_rays,
            closed_meshes_hold_every_ray,
            directions_of_any_length,
            edge_on_triangles_are_not_hit,
            edges_and_corners_belong_to_all_their_triangles,
            every_power_of_two,
            extreme_directions,
            extreme_scenes,
            flat_along_each_axis,
            grazing_rays,
            hits_at_equal_distances,
            hits_beside_a_needle,
            hits_from_outside_the_box,
            nasty_scenes,
            no_triangles_no_hits,
            one_triangle,
            ranges_are_closed,
            rays_almost_in_a_face,
            rays_along_axes_through_everything,
            rays_from_anywhere,
            rays_that_cannot_hit_do_not,
            scales_and_offsets,
            the_ends_of_f32,
            triangles_without_area_are_not_hit,
        }
    };
    ($run:path: $($name:ident,)*) => {
        $(
            #[test]
            fn $name() {
                $run(stringify!($name), $crate::trials::$name);
            }
        )*
    };
}

/// A mesh and the structures over it.
struct Over<'a> {
    name: String,
    mesh: &'a Mesh,
    structures: Vec<Structure<'a>>,
}

impl<'a> Over<'a> {
    fn new(subject: &Subject, name: impl Into<String>, mesh: &'a Arc<Mesh>) -> Self {
        let (name, structures) = (name.into(), (subject.build)(mesh));
        assert!(!structures.is_empty(), "{name}: nothing is tested");
        Self {
            name,
            mesh,
            structures,
        }
    }

    fn queries(&self) -> Vec<&dyn RayQuery<Hit = Hit>> {
        let queries = self.structures.iter();
        queries
            .map(|one| &*one.query as &dyn RayQuery<Hit = Hit>)
            .collect()
    }

    /// Checks every query of a ray. Returns the number of hits.
    #[track_caller]
    fn check(&self, ray: &Ray) -> usize {
        check(&self.name, self.mesh, &self.queries(), ray)
    }

    /// Checks every query of a ray with `hits` hits.
    #[track_caller]
    fn expect(&self, ray: &Ray, hits: usize) {
        assert_eq!(self.check(ray), hits, "{}: {}", self.name, source(ray));
    }

    /// Checks every query of rays as one batch and in packets of eight.
    #[track_caller]
    fn check_together(&self, rays: &[Ray]) {
        let expected = rays.iter().map(|ray| {
            let mut hits = Vec::new();
            brute_force::hits(self.mesh, ray, usize::MAX, &mut hits);
            hits
        });
        let expected: Vec<Vec<Hit>> = expected.collect();
        for (number, structure) in self.structures.iter().enumerate() {
            let name = format!("{}, structure {number}", self.name);
            check_batch(&name, &&*structure.query, rays, &expected);
        }
    }

    /// Random rays around the mesh and the planes of the structures.
    fn random_rays(&self, seed: u64) -> Rays<'a> {
        let planes = self.structures.iter().flat_map(|one| &one.planes);
        Rays::new(self.mesh, planes.copied().collect(), seed)
    }

    /// Checks random rays, of which at least `per_cent` in a hundred must hit.
    #[track_caller]
    fn check_random(&self, seed: u64, rays: usize, per_cent: usize) {
        // Fewer than a hundred rays say little about the share that hits.
        let rays = effort::count(rays.div_ceil(10).max(rays.min(100)), rays);
        let mut source = self.random_rays(seed);
        let hit = (0..rays).filter(|_| self.check(&source.draw()) > 0).count();
        let name = &self.name;
        assert!(100 * hit >= per_cent * rays, "{name}: {hit} of {rays} hit");
    }
}

/// Every trial can fail.
#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use super::*;

    /// An error in answers.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Flaw {
        /// The closest hit is one unit in the last place further away.
        Moved,
        /// The closest hit is missing.
        Lost,
        /// No ray is occluded.
        Hidden,
        /// The last of the hits is missing.
        Dropped,
        /// Every ray is occluded.
        Invented,
    }

    const FLAWS: [Option<Flaw>; 6] = [
        None,
        Some(Flaw::Moved),
        Some(Flaw::Lost),
        Some(Flaw::Hidden),
        Some(Flaw::Dropped),
        Some(Flaw::Invented),
    ];

    struct Flawed<'a>(&'a Mesh, Option<Flaw>);

    impl RayQuery for Flawed<'_> {
        type Hit = Hit;

        fn intersect(&self, ray: &Ray) -> Option<Hit> {
            let hit = brute_force::intersect(self.0, ray);
            match (self.1, hit) {
                (Some(Flaw::Moved), Some(hit)) => Some(Hit {
                    t: hit.t.next_up(),
                    ..hit
                }),
                (Some(Flaw::Lost), Some(_)) => None,
                _ => hit,
            }
        }

        fn occluded(&self, ray: &Ray) -> bool {
            match self.1 {
                Some(Flaw::Hidden) => false,
                Some(Flaw::Invented) => true,
                _ => brute_force::occluded(self.0, ray),
            }
        }

        fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
            brute_force::hits(self.0, ray, max, out);
            if self.1 == Some(Flaw::Dropped) {
                out.pop();
            }
        }
    }

    /// Brute force without a flaw, then with the flaw of that number.
    fn build<const FLAW: usize>(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
        let mut structures = vec![Structure::new(Flawed(mesh, None), Vec::new())];
        if FLAWS[FLAW].is_some() {
            structures.push(Structure::new(Flawed(mesh, FLAWS[FLAW]), Vec::new()));
        }
        structures
    }

    /// A trial passes without a flaw and fails with each flaw that it can show: not with invented hits if all of its rays hit, nor
    /// with the other flaws if none does.
    fn notices_every_flaw(name: &str, trial: Trial) {
        let only_misses = ["no_triangles_no_hits", "triangles_without_area_are_not_hit"];
        let only_hits = [
            "closed_meshes_hold_every_ray",
            "rays_along_axes_through_everything",
            "rays_from_anywhere",
        ];
        let builds: [Build; 6] = [
            build::<0>, build::<1>, build::<2>, build::<3>, build::<4>, build::<5>,
        ];
        for (flaw, build) in FLAWS.into_iter().zip(builds) {
            let shows = match flaw {
                None => false,
                Some(Flaw::Invented) => !only_hits.contains(&name),
                Some(_) => !only_misses.contains(&name),
            };
            if flaw.is_none() || shows {
                let (rays, points) = (500, 2);
                let subject = Subject {
                    build,
                    rays,
                    points,
                };
                let passes = catch_unwind(|| trial(&subject)).is_ok();
                assert_eq!(passes, flaw.is_none(), "{name}, {flaw:?}");
            }
        }
    }

    crate::trials!(notices_every_flaw);
}
