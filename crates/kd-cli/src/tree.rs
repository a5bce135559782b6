//! The tree that a command traces: built from a scene, or opened from a file.
#![allow(
    unsafe_code,
    reason = "a tree file is mapped into memory: as with `numpy.memmap`, it must not be changed meanwhile"
)]

use std::ops::ControlFlow;
use std::path::Path;

use kd::{KdTree, Mesh};
use kd_scene::SceneDescription;

use crate::print::progress_bar;
use crate::scene::{Builder, SceneArgs};

/// A tree, and the scene that it is of at a time. A tree from a file has a scene without parts and lights.
pub(crate) struct SceneTree {
    pub(crate) scene: SceneDescription,
    pub(crate) time: f64,
    pub(crate) tree: KdTree,
}

impl SceneTree {
    /// Opens the tree, or loads the scene and builds one.
    pub(crate) fn new(arguments: &SceneArgs, builder: Builder) -> anyhow::Result<Self> {
        if let Some(tree) = open(arguments)? {
            return Ok(Self {
                scene: SceneDescription::default(),
                time: 0.0,
                tree,
            });
        }
        let scene = arguments.load_with_warnings()?;
        let time = arguments.time(&scene)?;
        let tree = build(scene.mesh_at(time)?, builder)?;
        Ok(Self { scene, time, tree })
    }
}

/// The tree of the file `….kd` that the arguments name, verified and mapped; `None` if they name something else.
pub(crate) fn open(arguments: &SceneArgs) -> anyhow::Result<Option<KdTree>> {
    let path = Path::new(&arguments.scene);
    let is_tree = path.extension().is_some_and(|kind| kind == "kd");
    if !is_tree {
        return Ok(None);
    }
    // SAFETY: whoever runs the program does not change its input meanwhile; `kd` itself replaces files as a whole.
    let tree = unsafe { KdTree::open_verified(path) }?;
    Ok(Some(tree))
}

/// Builds a tree, and shows how much is done.
pub(crate) fn build(mesh: Mesh, builder: Builder) -> anyhow::Result<KdTree> {
    const PARTS: u64 = 1 << 10;
    let bar = progress_bar(Some(PARTS), "building {bar:40} {percent} % {eta}");
    let progress = |done: f32| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to 1024"
        )]
        bar.set_position((done * PARTS as f32) as u64);
        ControlFlow::Continue(())
    };
    let tree = KdTree::build_with_progress(mesh, &builder.options(), &progress);
    bar.finish_and_clear();
    Ok(tree?)
}
