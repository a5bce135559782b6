//! Trees in files: what is saved is what is loaded, opened and traced; what is damaged or forged is refused.
#![allow(
    unsafe_code,
    reason = "`open` is unsafe: these files do not change while they are open"
)]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use kd::glam::{Affine3A, DAffine3, DVec3, Vec3};
use kd::tree::FileError;
use kd::{BuildOptions, Hit, KdTree, Layout, MergeMethod, Mesh, Method, Ray, Scene, Strategy};
use kd_file::{Contents, SavedFile, Section, SectionKind};
use kd_scene::Spd;
use tempfile::TempDir;

fn open(path: &Path) -> Result<KdTree, FileError> {
    // SAFETY: `save` wrote the file, and nothing changes it.
    unsafe { KdTree::open(path) }
}

fn open_verified(path: &Path) -> Result<KdTree, FileError> {
    // SAFETY: nothing changes the file.
    unsafe { KdTree::open_verified(path) }
}

/// A folder for a file, and the name of the file.
fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("tree.kd");
    (folder, path)
}

fn options() -> [BuildOptions; 5] {
    [
        BuildOptions::fast(),
        BuildOptions::balanced().with_max_refs(5000),
        BuildOptions::best(),
        BuildOptions::best().with_method(Method::Binned { bins: 32 }),
        BuildOptions::balanced().with_layout(Layout::Binary),
    ]
}

/// All hits of some rays from the camera of a scene.
fn all_hits(tree: &KdTree, rays: &[Ray]) -> Vec<Vec<Hit>> {
    let of_ray = |ray: &Ray| {
        let mut hits = Vec::new();
        tree.hits(ray, usize::MAX, &mut hits);
        hits
    };
    rays.iter().map(of_ray).collect()
}

fn gears() -> (Mesh, Vec<Ray>) {
    let scene = Spd::Gears.generate(1).expect("a small size");
    let view = scene.camera.view(1.0);
    let rays = (0..40 * 40).map(|pixel| {
        let through = view.through_pixel(pixel % 40, pixel / 40, 40, 40);
        Ray::new(view.eye, through)
    });
    (scene.mesh, rays.collect())
}

/// A tree whose file is small enough to change every byte.
fn small(layout: Layout) -> KdTree {
    let corner = |i: u32| {
        let i = i as f32;
        [(0.7 * i).sin(), (0.3 * i).cos(), 0.1 * i]
    };
    let triangles = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh::new((0..36).map(corner).collect(), triangles).expect("valid");
    let options = BuildOptions::balanced().with_layout(layout);
    KdTree::build(mesh, &options).expect("within limits")
}

#[test]
fn a_tree_is_the_same_in_memory_and_in_its_file() {
    let (_folder, path) = place();
    let (mesh, rays) = gears();
    for options in options() {
        let tree = KdTree::build(mesh.clone(), &options).expect("within limits");
        let tree = tree.with_origin([1.0, 5.2e6, -0.1]);
        let hits = all_hits(&tree, &rays);
        assert!(hits.iter().flatten().count() > 1000, "the scene is in view");
        tree.save(&path).expect("written");
        let bytes = std::fs::read(&path).expect("just written");
        for read in [
            KdTree::load,
            |path: &PathBuf| open_verified(path),
            |path: &PathBuf| open(path),
        ] {
            let same = read(&path).expect("just written");
            assert_eq!(same.layout(), tree.layout(), "{options:?}");
            assert!(same.mesh() == tree.mesh(), "{options:?}");
            assert_eq!(all_hits(&same, &rays), hits, "{options:?}");
            assert_eq!(same.stats(), tree.stats(), "{options:?}");
            assert_eq!((same.origin(), same.options()), (tree.origin(), &options));
            let again = path.with_extension("again");
            same.save(&again).expect("written");
            let again = std::fs::read(again).expect("just written");
            assert!(
                again == bytes,
                "written again, the bytes are the same: {options:?}"
            );
        }
    }
}

#[test]
fn a_tree_without_a_kd_tree_builds_it_after_it_was_opened() {
    let (_folder, path) = place();
    let (mesh, _) = gears();
    for options in options() {
        let tree = KdTree::build(mesh.clone(), &options).expect("within limits");
        tree.save(&path).expect("written");
        for same in [KdTree::load(&path), open(&path), open_verified(&path)] {
            let same = same.expect("just written");
            assert_eq!(same.nodes(), tree.nodes(), "{options:?}");
            let other = same.with_layout(Layout::Binary).expect("within limits");
            let expected = tree.clone().with_layout(Layout::Binary);
            let expected = expected.expect("within limits");
            assert_eq!(other.stats(), expected.stats(), "{options:?}");
        }
    }
}

#[test]
fn an_empty_tree_can_be_saved_and_opened() {
    let (_folder, path) = place();
    for layout in [Layout::Wide, Layout::Binary] {
        let mesh = Mesh::new(vec![], vec![]).expect("valid");
        let options = BuildOptions::balanced().with_layout(layout);
        let tree = KdTree::build(mesh, &options).expect("an empty tree");
        tree.save(&path).expect("written");
        for same in [KdTree::load(&path), open(&path), open_verified(&path)] {
            let same = same.expect("just written");
            let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
            assert!(same.mesh().is_empty() && !same.occluded(&ray));
        }
    }
}

#[test]
fn an_opened_tree_outlives_the_name_of_its_file() {
    let (folder, path) = place();
    let (mesh, rays) = gears();
    let tree = KdTree::build(mesh, &BuildOptions::fast()).expect("within limits");
    tree.save(&path).expect("written");
    let opened = open(&path).expect("just written");
    let copy = opened.clone();
    small(Layout::Wide)
        .save(&path)
        .expect("it replaces the file");
    drop(opened);
    drop(folder);
    assert_eq!(all_hits(&copy, &rays), all_hits(&tree, &rays));
}

#[test]
fn every_truncation_is_refused() {
    let (_folder, path) = place();
    for layout in [Layout::Wide, Layout::Binary] {
        small(layout).save(&path).expect("written");
        let bytes = std::fs::read(&path).expect("just written");
        let longer = [&bytes[..], &[0]].concat();
        let cut = |end: usize| &bytes[..end];
        for bytes in (0..bytes.len()).map(cut).chain([&longer[..]]) {
            std::fs::write(&path, bytes).expect("written");
            for read in [KdTree::load(&path), open(&path), open_verified(&path)] {
                let error = read.expect_err("truncated").to_string();
                assert!(error.contains("tree.kd: "), "{}: {error}", bytes.len());
            }
        }
    }
}

#[test]
fn every_changed_byte_is_refused() {
    let (_folder, path) = place();
    for layout in [Layout::Wide, Layout::Binary] {
        small(layout).save(&path).expect("written");
        let bytes = std::fs::read(&path).expect("just written");
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (at % 8);
            std::fs::write(&path, changed).expect("written");
            for read in [KdTree::load(&path), open_verified(&path)] {
                let error = read.map(|_| ()).expect_err("changed").to_string();
                assert!(error.contains("tree.kd: "), "byte {at}: {error}");
            }
        }
    }
}

#[test]
fn other_files_are_refused_by_what_they_are() {
    let (_folder, path) = place();
    small(Layout::Wide).save(&path).expect("written");
    let bytes = std::fs::read(&path).expect("just written");
    let with = |at: usize, word: [u8; 4]| {
        let mut changed = bytes.clone();
        changed[at..at + 4].copy_from_slice(&word);
        std::fs::write(&path, changed).expect("written");
        let errors = [KdTree::load(&path), open(&path), open_verified(&path)];
        let [first, second, third] = errors.map(|read| read.expect_err("changed").to_string());
        assert!(
            first == second && second == third,
            "{first}; {second}; {third}"
        );
        first
            .split_once("tree.kd: ")
            .expect("the name")
            .1
            .to_owned()
    };
    assert_eq!(with(0, *b"ply\n"), "not a kd-tree file");
    for (version, byte) in [(1, [1, 0, 0, 0]), (3, [3, 0, 0, 0])] {
        let expected = format!("format version {version} is not supported, expected 2");
        assert_eq!(with(8, byte), expected);
    }
    assert_eq!(with(12, [4, 3, 2, 1]), "numbers are in another byte order");
    assert_eq!(with(28, [9, 9, 9, 9]), "the header is damaged");
    let folder = path.parent().expect("a folder");
    let mut no_files = vec![path.with_extension("gone"), folder.to_owned()];
    if cfg!(unix) {
        // Endless.
        no_files.push("/dev/zero".into());
    }
    for path in &no_files {
        for read in [KdTree::load(path), open(path), open_verified(path)] {
            let error = read.expect_err("no file");
            assert!(matches!(error, FileError::Io { .. }), "{error}");
        }
    }
    std::fs::write(&path, "").expect("written");
    for read in [KdTree::load(&path), open(&path), open_verified(&path)] {
        let error = read.expect_err("empty");
        assert!(matches!(error, FileError::WrongMagic { .. }), "{error}");
    }
}

/// The elements of a section, to forge.
fn words(file: &SavedFile, kind: SectionKind) -> Vec<u32> {
    let section = Section::new(kind, 0);
    let words = |bytes: &[u8]| bytemuck::pod_collect_to_vec(bytes);
    match kind {
        SectionKind::Tree | SectionKind::KdReferences => {
            file.elements::<u32>(section).expect("there").into_vec()
        }
        SectionKind::Positions | SectionKind::Triangles => {
            let elements = file.elements::<[u32; 3]>(section).expect("there");
            words(bytemuck::cast_slice(&elements))
        }
        SectionKind::WideNodes => {
            let elements = file.elements::<[u32; 64]>(section).expect("there");
            words(bytemuck::cast_slice(&elements))
        }
        SectionKind::WideBlocks | SectionKind::BinaryBlocks => {
            let elements = file.elements::<[u32; 80]>(section).expect("there");
            elements.iter().flatten().copied().collect()
        }
        _ => {
            let elements = file.elements::<[u32; 4]>(section).expect("there");
            words(bytemuck::cast_slice(&elements))
        }
    }
}

/// A file with one word of a section changed, and checksums that match; `None` leaves the section out.
fn forge(from: &Path, to: &Path, kind: SectionKind, change: Option<(usize, u32)>) {
    let file = SavedFile::open(from).expect("valid");
    let kinds = [
        SectionKind::Tree,
        SectionKind::Positions,
        SectionKind::Triangles,
        SectionKind::WideNodes,
        SectionKind::WideBlocks,
        SectionKind::BinaryNodes,
        SectionKind::BinaryBlocks,
        SectionKind::KdNodes,
        SectionKind::KdReferences,
    ];
    let there = kinds
        .into_iter()
        .filter(|kind| file.has(Section::new(*kind, 0)));
    let there = there.filter(|there| *there != kind || change.is_some());
    let mut sections: Vec<(SectionKind, Vec<u32>)> =
        there.map(|kind| (kind, words(&file, kind))).collect();
    let mut contents = Contents::new();
    for (there, words) in &mut sections {
        if let (true, Some((at, word))) = (*there == kind, change) {
            words[at] = word;
        }
        let section = Section::new(*there, 0);
        match there {
            SectionKind::Tree | SectionKind::KdReferences => contents.add(section, words),
            SectionKind::Positions | SectionKind::Triangles => {
                contents.add::<[u32; 3]>(section, bytemuck::cast_slice(words));
            }
            SectionKind::WideNodes => {
                contents.add(section, words.as_chunks::<64>().0);
            }
            SectionKind::WideBlocks | SectionKind::BinaryBlocks => {
                contents.add(section, words.as_chunks::<80>().0);
            }
            _ => contents.add::<[u32; 4]>(section, bytemuck::cast_slice(words)),
        }
    }
    contents.save(to).expect("written");
}

#[test]
fn forged_files_with_valid_checksums_are_refused() {
    let (_folder, path) = place();
    let forged = path.with_extension("forged");
    let error = |layout, kind, change| {
        small(layout).save(&path).expect("written");
        forge(&path, &forged, kind, change);
        let errors = [KdTree::load(&forged), open_verified(&forged)];
        let [first, second] = errors.map(|read| read.expect_err("forged").to_string());
        assert_eq!(first, second);
        first
            .split_once("tree.forged: ")
            .expect("the name")
            .1
            .to_owned()
    };
    let nan = f32::NAN.to_bits();
    let wide = |kind, at, word| error(Layout::Wide, kind, Some((at, word)));
    let binary = |kind, at, word| error(Layout::Binary, kind, Some((at, word)));
    use SectionKind::{
        BinaryBlocks, BinaryNodes, KdNodes, KdReferences, Positions, Tree, Triangles, WideBlocks,
        WideNodes,
    };
    assert_eq!(wide(Positions, 4, nan), "vertex 1 is not finite");
    assert_eq!(
        wide(Triangles, 5, 36),
        "triangle 1, corner 2: index 36 is out of range, there are 36 vertices"
    );
    assert_eq!(
        wide(Positions, 0, 50.0_f32.to_bits()),
        "the bounds differ from those of the mesh"
    );
    assert_eq!(
        wide(Tree, 0, 99),
        "tree properties: option `method` must be one that this version has"
    );
    assert_eq!(wide(Tree, 30, 77), "the root is not in the layout");
    assert_eq!(
        wide(Tree, 34, 0x7ff0_0000),
        "tree properties: the origin is not finite"
    );
    assert_eq!(
        wide(WideNodes, 48, 0),
        "node 0, child 0: not stored behind the node"
    );
    assert_eq!(
        wide(WideBlocks, 72, 12),
        "block 0, lane 0: not a triangle of the mesh"
    );
    assert_eq!(
        binary(KdReferences, 0, 12),
        "reference 0: triangle 12 is out of range, there are 12 triangles"
    );
    assert_eq!(
        binary(KdNodes, 0, 7),
        "leaf 0: references 7 + 12 are out of range, the arena has 12"
    );
    assert_eq!(binary(BinaryNodes, 0, 1), "node 0: not that of the kd-tree");
    assert_eq!(
        binary(BinaryBlocks, 73, 0),
        "block 0, lane 1: not a triangle of the mesh"
    );
    for (layout, kind, name) in [
        (Layout::Wide, Tree, "tree properties"),
        (Layout::Wide, Triangles, "triangles"),
        (Layout::Wide, WideNodes, "wide nodes"),
        (Layout::Binary, BinaryBlocks, "blocks of binary nodes"),
        (Layout::Binary, KdNodes, "nodes of the kd-tree"),
    ] {
        assert_eq!(error(layout, kind, None), format!("has no {name}"));
    }
}

#[test]
fn a_failed_save_leaves_no_file_and_no_change() {
    let (folder, path) = place();
    let tree = small(Layout::Wide);
    let error = tree.save(folder.path().join("nowhere/tree.kd"));
    let error = error.expect_err("no such folder");
    assert!(matches!(error, FileError::Io { .. }), "{error}");
    // A folder cannot be replaced by a file: the save fails at the end.
    std::fs::create_dir(&path).expect("a folder");
    let error = tree.save(&path).expect_err("a folder is there");
    assert!(error.to_string().contains("tree.kd: "), "{error}");
    assert!(path.is_dir(), "as it was");
    let left = std::fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(left, 1, "nothing but the folder");
}

#[test]
fn trees_are_saved_under_one_name_at_once() {
    let (folder, path) = place();
    let tree = small(Layout::Wide);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..20 {
                    tree.save(&path).expect("written");
                    KdTree::load(&path).expect("whole at any time");
                }
            });
        }
    });
    let left = std::fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(left, 1, "nothing but the file");
}

/// A scene with every kind of part, one of which was removed.
fn scene_of_all_kinds(strategy: Strategy) -> Scene {
    let (mesh, _) = gears();
    let mesh = Arc::new(mesh);
    let mut scene = Scene::with_origin(BuildOptions::fast(), [1e6, 2e6, 0.0]).expect("finite");
    scene.set_strategy(strategy);
    scene.set_ray_budget(12_345_678_901);
    let gone = scene
        .add_static(small(Layout::Wide).mesh().clone())
        .expect("fits");
    let first = scene.add_static(Arc::clone(&mesh)).expect("fits");
    let moving = scene.add_dynamic(Arc::clone(&mesh)).expect("fits");
    let by = Affine3A::from_scale(Vec3::new(-1.0, 2.0, 0.5)) * Affine3A::from_translation(Vec3::X);
    scene.set_transform(moving, by).expect("finite");
    let instance = scene
        .add_instance(first, Affine3A::from_rotation_x(0.5))
        .expect("fits");
    scene.set_mask(instance, 6).expect("there");
    let far = DAffine3::from_translation(DVec3::new(1e6 + 0.3, 2e6, 1.0));
    scene.add_world_instance(moving, far).expect("fits");
    scene.remove(gone).expect("there");
    scene
}

#[test]
fn a_scene_is_the_same_from_its_file() {
    let (_folder, path) = place();
    let (_, rays) = gears();
    for strategy in [
        Strategy::Auto,
        Strategy::Refit,
        Strategy::Instances,
        Strategy::Dual,
        Strategy::Rebuild(BuildOptions::best()),
        Strategy::Merge(MergeMethod::PartitionTrees),
        Strategy::Merge(MergeMethod::Guided),
    ] {
        let mut scene = scene_of_all_kinds(strategy.clone());
        scene.save(&path).expect("written");
        let mut same = Scene::load(&path).expect("just written");
        let again = path.with_extension("again");
        same.save(&again).expect("written");
        let bytes = [&path, &again].map(|path| std::fs::read(path).expect("just written"));
        assert!(bytes[0] == bytes[1], "{strategy:?}");
        // A mesh and a section are there once, not once for each of three parts.
        assert!(bytes[0].len() < 2 * 574 * 24, "{} bytes", bytes[0].len());
        let report = scene.commit().expect("a frame");
        let of_same = same.commit().expect("a frame");
        assert_eq!(format!("{report:?}"), format!("{of_same:?}"));
        assert!(scene.parts().eq(same.parts()), "the same numbers");
        let mut hits = 0;
        for ray in &rays {
            for mask in [1, u32::MAX] {
                let ray = ray.with_mask(mask);
                let hit = scene.frame().intersect(&ray);
                assert_eq!(same.frame().intersect(&ray), hit, "{ray:?}");
                hits += usize::from(hit.is_some());
            }
        }
        assert!(hits > 200, "{hits}");
        let [next, next_of_same] = [&mut scene, &mut same].map(|scene| {
            let mesh = small(Layout::Wide).mesh().clone();
            scene.add_static(mesh).expect("fits")
        });
        assert_eq!(next, next_of_same, "no number is given again");
    }
}

#[test]
fn a_damaged_scene_is_refused() {
    let (_folder, path) = place();
    let mut scene = Scene::new(BuildOptions::fast());
    let part = scene
        .add_static(small(Layout::Wide).mesh().clone())
        .expect("fits");
    scene
        .add_instance(part, Affine3A::from_translation(Vec3::X))
        .expect("fits");
    scene.save(&path).expect("written");
    let bytes = std::fs::read(&path).expect("just written");
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 1 << (at % 8);
        std::fs::write(&path, &changed).expect("written");
        let error = Scene::load(&path).expect_err("changed").to_string();
        assert!(error.contains("tree.kd: "), "byte {at}: {error}");
        std::fs::write(&path, &changed[..at]).expect("written");
        Scene::load(&path).expect_err("truncated");
    }
    std::fs::write(&path, &bytes).expect("written");

    let forged = path.with_extension("forged");
    let error = |section: Section, at: usize, word: u32| {
        let file = SavedFile::open(&path).expect("valid");
        let of = |kind| Section::new(kind, 0);
        let mut words = file.elements::<u32>(of(SectionKind::Scene)).expect("there");
        let parts = file.elements::<[u32; 30]>(of(SectionKind::Parts));
        let mut parts = parts.expect("there").into_vec();
        if section == of(SectionKind::Scene) {
            words[at] = word;
        } else {
            parts.as_flattened_mut()[at] = word;
        }
        let [positions, triangles] = [SectionKind::Positions, SectionKind::Triangles]
            .map(|kind| file.elements::<[u32; 3]>(of(kind)).expect("there"));
        let mut contents = Contents::new();
        contents.add(of(SectionKind::Scene), &words);
        contents.add(of(SectionKind::Parts), &parts);
        contents.add(of(SectionKind::Positions), &positions);
        contents.add(of(SectionKind::Triangles), &triangles);
        contents.save(&forged).expect("written");
        let error = Scene::load(&forged).expect_err("forged").to_string();
        error.split_once("forged: ").expect("the name").1.to_owned()
    };
    let parts = Section::new(SectionKind::Parts, 0);
    let of_scene = Section::new(SectionKind::Scene, 0);
    for (section, at, word, message) in [
        (
            parts,
            30,
            0,
            "parts: part 1: its number, 0, is not in order",
        ),
        (parts, 1, 1, "parts: part 0: its mesh is missing"),
        (parts, 32, 3, "parts: part 1: its role is unknown"),
        (
            parts,
            36,
            f32::NAN.to_bits(),
            "parts: part 1: its transform is not finite",
        ),
        (of_scene, 48, 6, "scene properties: an unknown strategy"),
        (
            of_scene,
            0,
            99,
            "scene properties: option `method` must be one that this version has",
        ),
        (
            of_scene,
            54,
            0x7ff0_0000,
            "scene properties: the origin is not finite",
        ),
        (of_scene, 59, 2, "has no positions (1)"),
    ] {
        assert_eq!(error(section, at, word), message);
    }
    let tree = small(Layout::Wide);
    tree.save(&path).expect("written");
    let error = Scene::load(&path).expect_err("a tree").to_string();
    assert!(error.ends_with("has no scene properties"), "{error}");
}
