//! Measures kernels one at a time: `cargo bench -p kd-bench --features kernels`. `cargo xtask bench` measures whole scenes.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use kd::layout::{Level, WideTree};
use kd::{BuildOptions, KdTree, Layout, Mesh, Method, Ray};
use kd_scene::{Camera, Spd};

/// A scene that builds in milliseconds, and its camera.
fn scene() -> (Arc<Mesh>, Camera) {
    let setup = Spd::Gears.generate(2).expect("a small scene");
    (Arc::new(setup.mesh), setup.camera)
}

/// Rays through a grid of pixels.
fn camera_rays(camera: &Camera, side: u32) -> Vec<Ray> {
    let view = camera.view(1.0);
    let pixels = (0..side * side).map(|pixel| (pixel % side, pixel / side));
    pixels
        .map(|(column, row)| Ray::new(view.eye, view.through_pixel(column, row, side, side)))
        .collect()
}

fn build(criterion: &mut Criterion) {
    let (mesh, _) = scene();
    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    group.throughput(Throughput::Elements(mesh.len() as u64));
    for (name, method) in [("median", Method::Median), ("exact", Method::Exact)] {
        let options = BuildOptions::balanced().with_method(method).with_threads(1);
        group.bench_function(name, |bencher| {
            let build = |mesh| KdTree::build(mesh, &options).expect("a small scene");
            bencher.iter_batched(|| Arc::clone(&mesh), build, BatchSize::LargeInput);
        });
    }
    let tree = kd::custom::build(&*mesh, &BuildOptions::balanced()).expect("a small scene");
    group.bench_function("wide nodes", |bencher| {
        let options = BuildOptions::balanced().with_threads(1);
        let build = |mesh| KdTree::build(mesh, &options).expect("a small scene");
        bencher.iter_batched(|| Arc::clone(&mesh), build, BatchSize::LargeInput);
    });
    group.bench_function("wide nodes of a kd-tree", |bencher| {
        bencher.iter(|| WideTree::new(black_box(&tree), &mesh));
    });
    group.finish();
}

fn single_ray(criterion: &mut Criterion) {
    let (mesh, camera) = scene();
    let tree = KdTree::build(mesh, &BuildOptions::balanced()).expect("a small scene");
    let rays = camera_rays(&camera, 64);
    let mut group = criterion.benchmark_group("single ray");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("closest", |bencher| {
        bencher.iter(|| {
            rays.iter()
                .filter_map(|ray| tree.intersect(black_box(ray)))
                .count()
        });
    });
    let portable = tree.clone().with_level(Level::portable());
    group.bench_function("closest, portable", |bencher| {
        bencher.iter(|| {
            rays.iter()
                .filter_map(|ray| portable.intersect(black_box(ray)))
                .count()
        });
    });
    let binary = tree
        .clone()
        .with_layout(Layout::Binary)
        .expect("within limits");
    group.bench_function("closest, binary layout", |bencher| {
        bencher.iter(|| {
            rays.iter()
                .filter_map(|ray| binary.intersect(black_box(ray)))
                .count()
        });
    });
    group.bench_function("closest, batch", |bencher| {
        let mut hits = vec![None; rays.len()];
        bencher.iter(|| tree.intersect_batch(black_box(&rays), &mut hits));
    });
    group.bench_function("any", |bencher| {
        bencher.iter(|| {
            rays.iter()
                .filter(|ray| tree.occluded(black_box(ray)))
                .count()
        });
    });
    group.finish();
}

fn triangle_test(criterion: &mut Criterion) {
    let (mesh, camera) = scene();
    let rays = camera_rays(&camera, 2);
    let mut group = criterion.benchmark_group("triangle test");
    group.throughput(Throughput::Elements((mesh.len() * rays.len()) as u64));
    group.bench_function("every triangle", |bencher| {
        bencher.iter(|| {
            let hits = rays
                .iter()
                .filter_map(|ray| kd_trace::brute_force::intersect(&mesh, black_box(ray)));
            hits.count()
        });
    });
    group.finish();
}

criterion_group!(kernels, build, single_ray, triangle_test);
criterion_main!(kernels);
