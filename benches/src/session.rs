//! One scene under measurement: every command adds its cells here.

use std::sync::Arc;
use std::time::Duration;

use kd::Mesh;

use crate::arguments::name_of;
use crate::check::{Answers, as_source};
use crate::environment::Environment;
use crate::measure::{Pairs, Repeats, timed_in_pairs};
use crate::names::Variant;
use crate::peers;
use crate::rays::RayKind;
use crate::record::{self, Exact, Record, Timed};
use crate::structure::Manner;
use crate::workload::{Traced, Workload};

/// A scene, its rays, and the cells measured on it.
#[derive(Debug)]
pub(crate) struct Session<'a> {
    pub(crate) environment: &'a Environment,
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    pub(crate) repeats: Repeats,
    pub(crate) workloads: Vec<Workload>,
    pub(crate) cells: Vec<Record>,
    pub(crate) problems: Vec<String>,
}

impl<'a> Session<'a> {
    /// A session without rays that takes all `samples`.
    pub(crate) fn new(
        environment: &'a Environment,
        scene: impl Into<String>,
        triangles: usize,
        samples: usize,
    ) -> Self {
        Self {
            environment,
            scene: scene.into(),
            triangles,
            repeats: Repeats::all(samples),
            workloads: Vec::new(),
            cells: Vec::new(),
            problems: Vec::new(),
        }
    }

    /// The same session with no pair after `limit`.
    pub(crate) fn until(mut self, limit: Duration) -> Self {
        self.repeats.until = limit;
        self
    }

    /// A cell without figures. `subject` is structure, builder and layout, separated by slashes; no `rays` is a build.
    pub(crate) fn blank(&self, subject: &str, rays: &str, threads: usize, over: &str) -> Record {
        let mut names = subject.splitn(3, '/').map(String::from);
        let mut next = || names.next().unwrap_or_default();
        Record {
            schema: record::SCHEMA,
            rev: self.environment.rev.clone(),
            cpu: self.environment.cpu.clone(),
            rustc: self.environment.rustc.clone(),
            rustflags: self.environment.rustflags.clone(),
            threads,
            simd: self.environment.simd.clone(),
            scene: self.scene.clone(),
            triangles: self.triangles,
            structure: next(),
            builder: next(),
            layout: next(),
            rays: rays.to_owned(),
            baseline: over.to_owned(),
            library: peers::library_of(&[subject, over]),
            exact: Exact::default(),
            timed: Timed::default(),
        }
    }

    /// Adds a cell of build or update times on one thread.
    pub(crate) fn add_build(&mut self, subject: &str, over: &str, pairs: &Pairs) -> &mut Record {
        let mut cell = self.blank(subject, "", 1, over);
        (cell.timed.build_ms, cell.timed.baseline_build_ms) = pairs.scaled(1e3);
        self.add(cell)
    }

    /// Adds a cell of the times of `count` rays, on one thread.
    pub(crate) fn add_rays(
        &mut self,
        subject: &str,
        rays: &str,
        over: &str,
        pairs: &Pairs,
        count: usize,
    ) -> &mut Record {
        let mut cell = self.blank(subject, rays, 1, over);
        cell.exact.rays = count;
        let timed = &mut cell.timed;
        (timed.trace_ns_per_ray, timed.baseline_ns_per_ray) =
            pairs.scaled(1e9 / count.max(1) as f64);
        self.add(cell)
    }

    pub(crate) fn add(&mut self, cell: Record) -> &mut Record {
        self.cells.push(cell);
        self.cells.last_mut().expect("one was just added")
    }

    /// Times builds of a variant, each after one of another; both have a number of threads.
    pub(crate) fn build(
        &mut self,
        mesh: &Arc<Mesh>,
        (variant, threads): (Variant, usize),
        (over, over_threads): (Variant, usize),
    ) -> anyhow::Result<&mut Record> {
        let pairs = timed_in_pairs(
            self.repeats,
            || over.build_seconds(mesh, over_threads),
            || variant.build_seconds(mesh, threads),
        )?;
        let over = on_threads(&over.to_string(), over_threads, threads);
        let cell = self.add_build(&variant.to_string(), &over, &pairs);
        cell.threads = threads;
        Ok(cell)
    }

    pub(crate) fn workload(&self, kind: RayKind) -> &Workload {
        let mut all = self.workloads.iter();
        all.find(|workload| workload.kind == kind)
            .expect("the session has rays of this kind")
    }

    /// Times rays of a kind through a variant, each time after the baseline, and checks the answers.
    pub(crate) fn trace(
        &mut self,
        kind: RayKind,
        (variant, own): (Variant, Traced<'_>),
        (over, baseline): (Variant, Traced<'_>),
    ) -> &mut Record {
        let workload = self.workload(kind);
        let mut answers = Answers::none(kind, workload.rays.len());
        let pairs = workload.time(self.repeats, baseline, own, &mut answers);
        let rays = rays_name(kind, own.by);
        let over = on_threads(&over.to_string(), baseline.threads, own.threads);
        let count = workload.rays.len();
        let (exact, problems) = judged(workload, variant, &answers);
        let scene = &self.scene;
        let problems = problems
            .iter()
            .map(|what| format!("{scene} {variant} {rays}: {what}"));
        let problems: Vec<String> = problems.collect();
        self.problems.extend(problems);
        let cell = self.add_rays(&variant.to_string(), &rays, &over, &pairs, count);
        cell.threads = own.threads;
        cell.exact = exact;
        cell
    }
}

/// The name of a kind of rays in records.
pub(crate) fn rays_name(kind: RayKind, by: Manner) -> String {
    match by {
        Manner::Single => name_of(&kind),
        by => format!("{}-{}", name_of(&kind), name_of(&by)),
    }
}

/// The name of a baseline, with its threads where they differ from those of the cell.
pub(crate) fn on_threads(over: &str, over_threads: usize, threads: usize) -> String {
    if over_threads == threads {
        over.to_owned()
    } else {
        format!("{over} on {over_threads}")
    }
}

/// Hits and wrong answers: of ours those that differ from the reference's and from brute force, of a rival those that differ
/// too much. Texts name the first ray of each sort if the cell is wrong.
fn judged(workload: &Workload, variant: Variant, answers: &Answers) -> (Exact, Vec<String>) {
    let mut exact = Exact {
        rays: workload.rays.len(),
        hits: answers.hits(),
        hit_hash: answers.hash(),
        ..Exact::default()
    };
    let mut found = Vec::new();
    if variant.is_rival() {
        let disagreements = workload.expected.disagreements(answers);
        let share = disagreements.len() as f64 / workload.rays.len().max(1) as f64;
        exact.mismatches = disagreements.len();
        exact.disagreement_ppm = Some(share * 1e6);
        found.push(("ours", disagreements));
    } else {
        let from_reference = answers.differences(&workload.expected);
        let from_brute_force = workload.brute_force.differences(answers);
        exact.mismatches = from_reference.len();
        exact.brute_force_rays = workload.brute_force.rays.len();
        exact.brute_force_mismatches = from_brute_force.len();
        found.push(("the reference", from_reference));
        found.push(("a test of every triangle", from_brute_force));
    }
    let mut problems = Vec::new();
    if exact.is_wrong() {
        for (what, differences) in &found {
            if let Some(first) = differences.first() {
                let (count, ray) = (differences.len(), as_source(&workload.rays[*first]));
                problems.push(format!("{count} rays differ from {what}, first {ray}"));
            }
        }
    }
    (exact, problems)
}
