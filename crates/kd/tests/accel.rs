//! Every structure of `Accel` answers as a test of every triangle does.

use std::sync::Arc;

use kd::select::{Calibration, DecisionReason, Structure, Times};
use kd::{Accel, Mesh, Ray, RayBudget};
use kd_oracle::rays::Rays;
use kd_oracle::{check, check_batch, scenes};
use kd_scene::Spd;
use kd_trace::brute_force;

#[track_caller]
fn check_answers(name: &str, accel: &Accel, rays: usize) {
    let mesh = Arc::new(accel.mesh().clone());
    let mut source = Rays::new(&mesh, Vec::new(), 31);
    let rays: Vec<Ray> = (0..rays).map(|_| source.draw()).collect();
    let mut hits = vec![None; rays.len()];
    accel.intersect_batch(&rays, &mut hits);
    let mut occluded = vec![false; rays.len()];
    accel.occluded_batch(&rays, &mut occluded);
    for ((ray, hit), occluded) in rays.iter().zip(hits).zip(occluded) {
        check(name, &mesh, &[accel], ray);
        assert_eq!(hit, accel.intersect(ray), "{name}, in a batch: {ray:?}");
        assert_eq!(occluded, hit.is_some(), "{name}, in a batch: {ray:?}");
    }
    let few = &rays[..rays.len().min(200)];
    let expected = few.iter().map(|ray| {
        let mut hits = Vec::new();
        brute_force::hits(&mesh, ray, usize::MAX, &mut hits);
        hits
    });
    check_batch(name, accel, few, &expected.collect::<Vec<_>>());
}

#[test]
fn every_structure_answers_alike() {
    for (name, mesh) in scenes::all() {
        for structure in Structure::ALL {
            let accel = Accel::with(mesh.clone(), structure).expect("built");
            let decision = accel.decision().clone();
            assert_eq!(
                (decision.structure(), decision.reason()),
                (structure, DecisionReason::Requested),
                "{decision}"
            );
            check_answers(&format!("{name}, {structure}"), &accel, 1500);
        }
    }
}

#[test]
fn every_choice_answers_alike() {
    let mesh = Arc::new(Spd::Mount.generate(4).expect("small").mesh);
    let sample: Vec<Ray> = {
        let mut source = Rays::new(&mesh, Vec::new(), 32);
        (0..300).map(|_| source.draw()).collect()
    };
    for power in 0..=12 {
        let budget = RayBudget::new(10_u64.pow(power));
        for budget in [budget.clone(), budget.with_sample(sample.clone())] {
            let accel = Accel::auto(Arc::clone(&mesh), budget).expect("built");
            check_answers(&format!("10^{power} rays, {accel}"), &accel, 300);
        }
    }
}

/// At both ends the choice does not depend on measured times.
#[test]
fn hardly_any_rays_get_a_grid_and_very_many_do_not() {
    let mesh = Arc::new(Spd::Gears.generate(2).expect("small").mesh);
    let decided = |rays: u64| {
        let accel = Accel::auto(Arc::clone(&mesh), RayBudget::new(rays)).expect("built");
        accel.decision().clone()
    };
    for rays in [0, 1, 64] {
        let few = decided(rays);
        assert_eq!(
            (few.structure(), few.reason()),
            (Structure::Grid, DecisionReason::HardlyAnyRays),
            "{few}"
        );
        assert_eq!(few.choice(), None, "nothing was compared");
    }
    let some = decided(100);
    assert_eq!(some.reason(), DecisionReason::LeastTotal, "{some}");
    let choice = some.choice().expect("costs were compared");
    assert_eq!(
        choice.costs.len(),
        Structure::ALL.len(),
        "all structures: {some}"
    );
    let many = decided(u64::MAX);
    assert_eq!(many.reason(), DecisionReason::ManyRays, "{many}");
    assert_ne!(many.structure(), Structure::Grid, "{many}");
    let text = many.to_string();
    assert!(text.contains("more rays than a grid suits\n"), "{text}");
}

#[test]
fn meshes_of_no_and_of_one_triangle_are_decided() {
    let nothing = Mesh::new(vec![], vec![]).expect("valid");
    let one = Mesh::new(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
        vec![[0, 1, 2]],
    );
    let point = Mesh::new(vec![[1.0; 3]; 3], vec![[0, 1, 2]]);
    for mesh in [nothing, one.expect("valid"), point.expect("valid")] {
        for rays in [0, 1000, u64::MAX] {
            let accel = Accel::auto(mesh.clone(), RayBudget::new(rays)).expect("built");
            let ray = Ray::new([0.2, 0.2, 5.0], [0.0, 0.0, -1.0]);
            let expected = brute_force::intersect(&mesh, &ray);
            assert_eq!(accel.intersect(&ray), expected, "{accel}");
        }
    }
}

/// A trial of a grid, and a better structure.
#[test]
fn a_tried_grid_is_replaced_by_a_better_structure() {
    let mut calibration = Calibration::built_in();
    calibration.machine = kd::select::Machine::here();
    for (number, scene) in calibration.scenes.iter_mut().enumerate() {
        // Most scenes have only a grid, so that a grid is tried for any number of rays. In the others the best preset takes almost
        // no time.
        let grid = scene.times[&Structure::Grid];
        let best = Times::new(1e-3 * grid.build_seconds, 1e-3 * grid.ray_seconds);
        scene
            .times
            .retain(|structure, _| *structure == Structure::Grid);
        if number % 3 == 0 {
            scene.times.insert(Structure::Best, best);
        }
    }
    let mesh = Spd::Tetra.generate(5).expect("small").mesh;
    let accel = Accel::auto_by(mesh, RayBudget::new(1_000_000), &calibration).expect("built");
    let decision = accel.decision();
    assert_eq!(
        (decision.reason(), decision.structure()),
        (DecisionReason::LeastTotal, Structure::Best),
        "{accel}"
    );
}

/// A calibration of this machine: the built-in one with this machine's name.
#[test]
#[cfg(feature = "io")]
fn a_calibration_of_this_machine_decides() {
    use kd::select::{CalibrationError, RayScheme};

    let mut calibration = Calibration::built_in();
    let refused = Calibration::read(&calibration.to_json());
    let here = kd::select::Machine::here();
    if calibration.machine != here {
        let is_foreign = matches!(refused, Err(CalibrationError::OtherMachine { .. }));
        assert!(is_foreign, "{refused:?}");
    }
    calibration.machine = here;
    // Trees that take almost no time.
    for scene in &mut calibration.scenes {
        let grid = scene.times[&Structure::Grid];
        for (structure, times) in &mut scene.times {
            if *structure == Structure::Best {
                times.build_seconds = 1e-3 * grid.build_seconds;
                times.ray_seconds = 1e-3 * grid.ray_seconds;
            }
        }
    }
    let calibration = Calibration::read(&calibration.to_json()).expect("of this machine");
    assert!(
        calibration.of_scheme(RayScheme::Path).count() > 0,
        "both distributions"
    );
    let mesh = Spd::Tetra.generate(5).expect("small").mesh;
    let accel = Accel::auto_by(mesh, RayBudget::new(1000), &calibration).expect("built");
    assert_eq!(accel.decision().structure(), Structure::Best, "{accel}");
}
