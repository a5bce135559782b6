//! Every rival answers like brute force, within the tolerance of its own triangle test.
#![allow(clippy::print_stderr, reason = "a skipped test reports it")]

use kd_core::{Aabb, Hit, Mesh, Ray, RayPacket8};
use kd_oracle::scenes;
use kd_rivals::{
    EmbreeBuild, FIRST, Following, ObvhsBuild, Options, Purpose, Queries, Rival, RivalError,
    TinybvhBuild, embree_of_primitives,
};
use kd_trace::{PrimitiveHit, Primitives, brute_force};

const RIVALS: [Rival; 12] = [
    Rival::Embree(EmbreeBuild::Low, Purpose::Usual),
    Rival::Embree(EmbreeBuild::Medium, Purpose::Usual),
    Rival::Embree(EmbreeBuild::High, Purpose::Usual),
    Rival::Embree(EmbreeBuild::Medium, Purpose::Robust),
    Rival::Embree(EmbreeBuild::Medium, Purpose::FirstHits),
    Rival::Obvhs(ObvhsBuild::Fastest),
    Rival::Obvhs(ObvhsBuild::Medium),
    Rival::Obvhs(ObvhsBuild::Slow),
    Rival::Bvh,
    Rival::Parry3d,
    Rival::Tinybvh(TinybvhBuild::Medium),
    Rival::Tinybvh(TinybvhBuild::High),
];

/// The feature that contains a rival, and whether it is on.
fn feature_of(rival: Rival) -> (&'static str, bool) {
    match rival {
        Rival::Embree(..) => ("embree", cfg!(feature = "embree")),
        Rival::Tinybvh(..) => ("tinybvh", cfg!(feature = "tinybvh")),
        _ => ("crates", cfg!(feature = "crates")),
    }
}

/// The result of a build; `None` if the rival cannot be built here, for the reason that its feature and its library give.
fn built<T>(rival: Rival, result: Result<T, RivalError>) -> Option<T> {
    let (feature, is_on) = feature_of(rival);
    match result {
        Ok(built) => {
            assert!(is_on, "{rival:?} is compiled without its feature");
            Some(built)
        }
        Err(RivalError::NotCompiled(missing)) => {
            assert_eq!((missing, is_on), (feature, false), "{rival:?}");
            None
        }
        Err(RivalError::NotInstalled(why)) => {
            assert!(is_on && feature == "embree", "{rival:?}: {why}");
            eprintln!("skipped: {rival:?}: {why}");
            None
        }
        Err(error) => panic!("{rival:?}: {error}"),
    }
}

/// Rays to a disc in the unit sphere or to a ring around it, well away from the silhouette.
fn rays() -> Vec<Ray> {
    let eye = [3.0, 0.31, 0.17];
    let steps = || (-9_i16..=9).map(|step| 0.17 * f32::from(step) + 0.013);
    let points = steps().flat_map(|y| steps().map(move |z| (y, z)));
    let is_clear = |(y, z): &(f32, f32)| !(0.8..1.3).contains(&y.hypot(*z));
    let ray = |(y, z)| Ray::new(eye, [-3.0, y - eye[1], z - eye[2]]);
    points.filter(is_clear).map(ray).collect()
}

fn are_close(expected: &[Hit], found: &[Hit]) -> bool {
    let mut pairs = expected.iter().zip(found);
    expected.len() == found.len() && pairs.all(|(a, b)| (a.t - b.t).abs() < 1e-3)
}

/// Compares every query with brute force.
fn check(rival: &str, structure: &dyn Queries, mesh: &Mesh, rays: &[Ray]) {
    let expected: Vec<Option<Hit>> = rays
        .iter()
        .map(|ray| brute_force::intersect(mesh, ray))
        .collect();
    assert!(expected.iter().flatten().count() > 50, "rays that hit");
    assert!(
        expected.iter().filter(|hit| hit.is_none()).count() > 50,
        "rays that miss"
    );
    let mut single = vec![None; rays.len()];
    let mut each = single.clone();
    let mut batch = single.clone();
    let mut occluded = [vec![false; rays.len()], vec![false; rays.len()]];
    structure.intersect_each(rays, &mut each);
    structure.intersect_batch(rays, &mut batch);
    structure.occluded_each(rays, &mut occluded[0]);
    structure.occluded_batch(rays, &mut occluded[1]);
    for (index, ray) in rays.iter().enumerate() {
        single[index] = structure.intersect(ray);
        let is_hit = expected[index].is_some();
        let masked = ray.with_mask(2);
        assert_eq!(
            structure.intersect(&masked),
            single[index],
            "{rival}: masks"
        );
        let found = [
            occluded[0][index],
            occluded[1][index],
            structure.occluded(ray),
        ];
        assert_eq!(found, [is_hit; 3], "{rival}: {ray:?}");
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for max in [1, FIRST, 9] {
            brute_force::hits(mesh, ray, max, &mut ours);
            structure.hits(ray, max, &mut theirs);
            assert!(
                are_close(&ours, &theirs),
                "{rival}, first {max}: {ours:?} {theirs:?}"
            );
        }
    }
    // The last packet has free lanes.
    let packets = || rays.chunks(7).map(RayPacket8::new);
    let lanes = packets().flat_map(|packet| structure.intersect8(&packet).into_iter().take(7));
    let lanes: Vec<Option<Hit>> = lanes.take(rays.len()).collect();
    for found in [single, each, batch, lanes] {
        for (expected, found) in expected.iter().zip(&found) {
            assert!(
                are_close(expected.as_slice(), found.as_slice()),
                "{rival}: {expected:?} {found:?}"
            );
        }
    }
    for packet in packets() {
        let hits = structure.intersect8(&packet).map(|hit| hit.is_some());
        assert_eq!(structure.occluded8(&packet), hits, "{rival}");
        assert!(!hits[7], "{rival}: a lane without a ray");
    }
}

/// Squares of side 2 across the x axis.
struct Squares(Vec<f32>);

impl Primitives for Squares {
    fn count(&self) -> u32 {
        u32::try_from(self.0.len()).expect("few")
    }

    fn bounds(&self, square: u32) -> Aabb {
        let x = self.0[square as usize];
        Aabb {
            min: [x, -1.0, -1.0].into(),
            max: [x, 1.0, 1.0].into(),
        }
    }

    fn intersect(&self, square: u32, ray: &Ray) -> Option<PrimitiveHit> {
        let t = (self.0[square as usize] - ray.origin.x) / ray.direction.x;
        let point = ray.at(t);
        let is_hit = ray.t_min <= t && t <= ray.t_max && point.y.abs().max(point.z.abs()) <= 1.0;
        is_hit.then_some(PrimitiveHit {
            t,
            u: point.y,
            v: point.z,
        })
    }
}

#[test]
fn embree_asks_primitives_of_the_program() {
    let places = vec![-0.5, -2.0, 0.0, -1.0];
    let rival = Rival::Embree(EmbreeBuild::Medium, Purpose::Usual);
    let Some(scene) = built(rival, embree_of_primitives(Squares(places.clone()), 1)) else {
        return;
    };
    let squares = Squares(places);
    let rays = rays();
    let mut hits = vec![None; rays.len()];
    let mut occluded = vec![false; rays.len()];
    scene.structure.intersect_each(&rays, &mut hits);
    scene.structure.occluded_each(&rays, &mut occluded);
    let mut count = 0;
    for ((ray, found), occluded) in rays.iter().zip(hits).zip(occluded) {
        let all = (0..squares.count()).filter_map(|triangle| {
            let PrimitiveHit { t, u, v } = squares.intersect(triangle, ray)?;
            Some(Hit { t, u, v, triangle })
        });
        let first = all.reduce(|a, b| if b.is_before(&a) { b } else { a });
        assert_eq!(found, first, "{ray:?}");
        assert_eq!(scene.structure.intersect(ray), first, "{ray:?}");
        assert_eq!(occluded, first.is_some(), "{ray:?}");
        assert_eq!(scene.structure.occluded(ray), first.is_some(), "{ray:?}");
        count += usize::from(first.is_some());
    }
    assert!(count > 50 && count < rays.len(), "{count} are hit");
}

#[test]
fn every_query_of_every_rival_is_close_to_brute_force() {
    let (mesh, rays) = (scenes::sphere(3), rays());
    for rival in RIVALS {
        for threads in [1, 2] {
            let options = Options {
                threads,
                ..Options::default()
            };
            if let Some(built) = built(rival, rival.build(&mesh, options)) {
                check(&format!("{rival:?}"), &*built.structure, &mesh, &rays);
            }
        }
    }
}

#[test]
fn embree_follows_a_moving_mesh() {
    let (fixed, moving) = (scenes::sphere(1), scenes::sphere(3));
    let rival = Rival::Embree(EmbreeBuild::Medium, Purpose::Usual);
    let small = scenes::moved(&fixed, |at| 0.1 * at);
    let start = scenes::moved(&moving, |at| 2.0 * at);
    for following in [
        Following::Rebuild,
        Following::RebuildMoving,
        Following::Refit,
    ] {
        let Some(mut scene) = built(rival, following.build(&small, &start)) else {
            continue;
        };
        let whole = Mesh::concatenated([&small, &moving]).expect("small");
        scene
            .update(moving.positions())
            .expect("the same number of vertices");
        check(
            &format!("{following:?}"),
            scene.structure(),
            &whole,
            &rays(),
        );
        assert!(
            scene.update(&moving.positions()[1..]).is_err(),
            "a vertex is missing"
        );
    }
}

/// The name of the library is that of one of the two versions.
#[test]
fn embree_is_named_with_its_version() {
    match kd_rivals::embree_name() {
        Ok(name) => {
            eprintln!("these are answers of {name}");
            let mut versions = ["Embree 3.", "Embree 4."].into_iter();
            assert!(versions.any(|start| name.starts_with(start)), "{name}");
        }
        Err(why) => eprintln!("skipped: {why}"),
    }
}

/// The tests above for the version that they do not have in this process, if it is installed: a process opens one library.
#[cfg(feature = "embree")]
#[test]
fn the_other_version_of_embree_passes() {
    use std::env;
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};

    const PASS: [&str; 3] = [
        "every_query_of_every_rival_is_close_to_brute_force",
        "embree_follows_a_moving_mesh",
        "embree_is_named_with_its_version",
    ];
    let program = env::current_exe().expect("this program");
    let here = kd_rivals::embree_name().unwrap_or_default();
    for major in [3, 4] {
        if here.starts_with(&format!("Embree {major}.")) {
            continue;
        }
        let library = format!("{DLL_PREFIX}embree{major}{DLL_SUFFIX}.{major}");
        let output = std::process::Command::new(&program)
            .args(PASS)
            .args(["--exact", "--nocapture"])
            .env(kd_rivals::EMBREE_VARIABLE, &library)
            .output()
            .expect("it starts");
        let printed = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{library}: {printed}");
        let is_installed = printed.contains(&format!("these are answers of Embree {major}."));
        let is_skipped = printed.contains("skipped: Embree cannot be opened");
        assert!(is_installed != is_skipped, "{library}: {printed}");
        if is_skipped {
            eprintln!("skipped: all tests of Embree {major}, which is not installed");
        }
    }
}
