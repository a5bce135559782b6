//! The trials of every structure.

use std::sync::Arc;

use kd_core::{Mesh, Tree};
use kd_oracle::trials::{self, Structure, Trial};
use kd_sah::{BuildOptions, Method, build};

use crate::check::Subject;
use crate::random_tree::random_tree;

/// Good trees and bad ones.
fn trees(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
    let median = BuildOptions::default()
        .with_method(Method::Median)
        .with_max_depth(9);
    let good = [BuildOptions::best(), BuildOptions::default(), median];
    let mut trees = good
        .map(|options| build(&**mesh, &options).expect("valid"))
        .to_vec();
    trees.extend((20..23).map(|seed| random_tree(mesh, seed)));
    subjects(mesh, trees)
}

/// A good one and a bad one, where there are many rays.
fn two_trees(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
    let good = build(&**mesh, &BuildOptions::default()).expect("valid");
    subjects(mesh, vec![good, random_tree(mesh, 3)])
}

fn subjects(mesh: &Mesh, trees: Vec<Tree>) -> Vec<Structure<'_>> {
    let subject = |tree: Tree| {
        assert_eq!(tree.check_coverage(mesh), Ok(()), "nothing is missing");
        let subject = Subject::new(mesh, tree);
        let planes = subject.planes();
        Structure::new(subject, planes)
    };
    trees.into_iter().map(subject).collect()
}

fn run(name: &str, trial: Trial) {
    let (build, rays): (trials::Build, _) = match name {
        "closed_meshes_hold_every_ray" => (two_trees, 0),
        // There are more in `oracle.rs`.
        "nasty_scenes" | "extreme_scenes" => (two_trees, 5_000),
        "scales_and_offsets" => (trees, 3_000),
        _ => (trees, 5_000),
    };
    let points = usize::MAX;
    trial(&trials::Subject {
        build,
        rays,
        points,
    });
}

kd_oracle::trials!(run);
