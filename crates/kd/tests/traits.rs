//! The traits that users expect of public types.

use std::fmt::Debug;
use std::hash::Hash;

use kd::points::{Feature, Nearest};
use kd::scene::{CommitAction, CommitError, CommitReport, SceneError};
use kd::tree::{Axis, Node, NodeIndex, Tree};
use kd::world::{World, WorldMesh, WorldRay};
use kd::{
    Aabb, Accel, BuildError, BuildOptions, CostModel, Frame, FrameData, Hit, KdTree, Layout,
    LazyTree, MergeMethod, Mesh, Method, PartId, Ray, RayBudget, RayPacket8, Scene, Strategy,
    TreeStats,
};

fn shared<T: Send + Sync + Debug>() {}
fn value<T: Clone + PartialEq + Send + Sync + Debug>() {}
fn key<T: Copy + Eq + Hash + Send + Sync + Debug>() {}
fn default<T: Default>() {}
fn error<T: std::error::Error + Send + Sync + 'static>() {}

#[test]
fn structures_are_shared_between_threads() {
    shared::<KdTree>();
    shared::<LazyTree>();
    shared::<Accel>();
    shared::<Scene>();
    shared::<Frame<'_>>();
    shared::<FrameData>();
    shared::<World<KdTree>>();
    shared::<World<Frame<'_>>>();
    shared::<Tree>();
    shared::<kd::points::WindingNumbers>();
}

#[test]
fn data_are_values() {
    value::<Mesh>();
    value::<Ray>();
    value::<WorldMesh>();
    value::<WorldRay>();
    value::<RayPacket8>();
    value::<Hit>();
    value::<Nearest>();
    value::<kd::points::TriangleLists>();
    key::<Feature>();
    value::<Aabb>();
    value::<CostModel>();
    value::<BuildOptions>();
    value::<Strategy>();
    value::<RayBudget>();
    value::<TreeStats>();
    value::<CommitReport>();
    value::<Node>();
    key::<PartId>();
    key::<Method>();
    key::<Layout>();
    key::<MergeMethod>();
    key::<CommitAction>();
    key::<Axis>();
    key::<NodeIndex>();
    default::<BuildOptions>();
    default::<Aabb>();
    default::<Layout>();
    default::<Strategy>();
    default::<MergeMethod>();
    default::<FrameData>();
    default::<RayPacket8>();
}

#[test]
fn errors_cross_threads() {
    error::<BuildError>();
    error::<kd::MeshError>();
    error::<kd::tree::FileError>();
    error::<kd::tree::TreeError>();
    error::<SceneError>();
    error::<CommitError>();
    error::<kd::select::AccelError>();
    #[cfg(feature = "io")]
    error::<kd::LoadError>();
}
