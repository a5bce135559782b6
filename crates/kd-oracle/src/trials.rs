//! What every structure is put through: meshes and rays that are awkward, each in its own way, held against brute force.
//!
//! [`trials!`](crate::trials!) makes a test of each, so that a trial added here is one of every structure.

mod meshes;
mod rays;

pub use meshes::*;
pub use rays::*;

use kd_core::{Mesh, Ray};

use crate::check::{Answers, check, source};
use crate::effort;
use crate::rays::Rays;

/// What answers rays over a mesh: structures of one kind, each built in another way.
pub type Structures<'a> = Vec<Box<dyn Answers + 'a>>;

/// Builds what is to answer over a mesh.
pub type Build = for<'a> fn(&'a Mesh) -> Structures<'a>;

/// What is put through trials, and how much of them it is given.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    /// Builds it.
    pub build: Build,
    /// Random rays around each mesh of its own kind with the feature `long-tests`, a tenth of them without; a fifth of them where
    /// there is a row of scales.
    pub rays: usize,
    /// Most points in each closed mesh from which rays are aimed at all of its edges; at most two without `long-tests`.
    pub points: usize,
}

/// A trial.
pub type Trial = fn(&Subject);

/// A test of every trial, under its name: `run` is a function that is given the name and the [`Trial`].
#[macro_export]
macro_rules! trials {
    ($run:path) => {
        $crate::trials! {
            $run:
            a_hit_beside_its_triangle,
            along_an_axis_and_past_its_end,
            as_many_hits_as_asked_for,
            closed_meshes_hold_every_ray,
            directions_of_any_length,
            edge_on_triangles_are_not_hit,
            edges_and_corners_belong_to_all_their_triangles,
            extreme_directions,
            extreme_scenes,
            flat_along_each_axis,
            grazing_rays,
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

/// A mesh with what answers over it.
struct Over<'a> {
    name: String,
    mesh: &'a Mesh,
    structures: Structures<'a>,
}

impl<'a> Over<'a> {
    fn new(subject: &Subject, name: impl Into<String>, mesh: &'a Mesh) -> Self {
        let (name, structures) = (name.into(), (subject.build)(mesh));
        assert!(!structures.is_empty(), "{name}: nothing is tested");
        Self {
            name,
            mesh,
            structures,
        }
    }

    fn answers(&self) -> Vec<&dyn Answers> {
        self.structures.iter().map(|one| &**one).collect()
    }

    /// Asks everything about a ray. Gives the number of hits.
    #[track_caller]
    fn ask(&self, ray: &Ray) -> usize {
        check(&self.name, self.mesh, &self.answers(), ray)
    }

    /// The same, of a ray that has so many.
    #[track_caller]
    fn expect(&self, ray: &Ray, hits: usize) {
        assert_eq!(self.ask(ray), hits, "{}: {}", self.name, source(ray));
    }

    /// Asks about random rays around the mesh and the planes of structures. Gives how many hit.
    #[track_caller]
    fn ask_random(&self, seed: u64, rays: usize) -> usize {
        let planes = self.structures.iter().flat_map(|one| one.planes());
        let mut source = Rays::new(self.mesh, planes.collect(), seed);
        (0..rays).filter(|_| self.ask(&source.draw()) > 0).count()
    }

    /// The same; so many in a hundred must hit, at least.
    #[track_caller]
    fn ask_random_and_hit(&self, seed: u64, rays: usize, per_cent: usize) {
        let rays = effort::count(rays.div_ceil(10), rays);
        let hit = self.ask_random(seed, rays);
        let name = &self.name;
        assert!(100 * hit >= per_cent * rays, "{name}: {hit} of {rays} hit");
    }
}

/// Every trial can fail.
#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use kd_core::Hit;
    use kd_trace::brute_force;

    use super::*;

    /// What is wrong with answers.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Flaw {
        /// The closest hit is one unit in the last place further away.
        Moved,
        /// There is no closest hit.
        Lost,
        /// There is no hit at all.
        Hidden,
        /// One of the first hits is not there.
        Dropped,
        /// What is missed is hit.
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

    impl Answers for Flawed<'_> {
        fn closest(&self, ray: &Ray) -> Option<Hit> {
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

        fn any(&self, ray: &Ray) -> bool {
            match self.1 {
                Some(Flaw::Hidden) => false,
                Some(Flaw::Invented) => true,
                _ => brute_force::occluded(self.0, ray),
            }
        }

        fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
            brute_force::hits(self.0, ray, max, out);
            if self.1 == Some(Flaw::Dropped) {
                out.pop();
            }
        }
    }

    /// What is right, and with it what has that flaw.
    fn build<const FLAW: usize>(mesh: &Mesh) -> Structures<'_> {
        let mut structures: Structures<'_> = vec![Box::new(Flawed(mesh, None))];
        if FLAWS[FLAW].is_some() {
            structures.push(Box::new(Flawed(mesh, FLAWS[FLAW])));
        }
        structures
    }

    /// Passes what is right, and no flaw: but for what is invented where all rays hit, and all others where none does.
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
