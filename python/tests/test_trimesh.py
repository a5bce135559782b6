"""`kd.trimesh`, beside trimesh's own slow intersector and analytic answers."""

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

import kd._kd  # noqa: E402
import kd.trimesh  # noqa: E402
import meshes  # noqa: E402


def sphere(subdivisions=3):
    return trimesh.creation.icosphere(subdivisions=subdivisions)


def rays(count=2000, seed=0):
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(-1.5, 1.5, (2, count, 3))
    return start, 3.7 * (end - start)


def test_every_vertex_and_edge_of_a_sphere_is_hit_once():
    mesh = sphere(5)
    assert len(mesh.faces) == 20480
    targets = np.vstack([mesh.vertices, mesh.vertices[mesh.edges_unique].mean(axis=1)])
    assert len(targets) == 40962
    ray = kd.trimesh.RayMeshIntersector(mesh)
    for eye in ([0.0, 0.0, 0.0], [0.1, 0.05, 0.02], [1e-9, 0.0, 0.0]):
        origins = np.tile(eye, (len(targets), 1))
        locations, index_ray, index_tri = ray.intersects_location(origins, targets - eye)
        assert np.array_equal(index_ray, np.arange(len(targets))), "one each, in order"
        np.testing.assert_allclose(locations, targets, atol=1e-6)
        assert np.array_equal(ray.intersects_first(origins, targets - eye) >= 0, [True] * len(targets))


def test_answers_are_those_of_the_slow_intersector():
    pytest.importorskip("rtree")
    from trimesh.ray import ray_triangle

    mesh = trimesh.util.concatenate([sphere(2), trimesh.creation.box([0.8, 2.5, 0.5]), trimesh.creation.torus(1.2, 0.2)])
    origins, directions = rays()
    fast, slow = kd.trimesh.RayMeshIntersector(mesh), ray_triangle.RayMeshIntersector(mesh)
    for multiple in (True, False):
        found = fast.intersects_id(origins, directions, multiple_hits=multiple, return_locations=True)
        expected = slow.intersects_id(origins, directions, multiple_hits=multiple, return_locations=True)
        order = np.lexsort([np.linalg.norm(expected[2] - origins[expected[1]], axis=1), expected[1]])
        assert [a.dtype for a in found] == [np.int64, np.int64, np.float64]
        assert np.array_equal(found[1], expected[1][order]) and np.array_equal(found[0], expected[0][order])
        np.testing.assert_allclose(found[2], expected[2][order], atol=1e-12)
    first = fast.intersects_first(origins, directions)
    assert first.dtype == np.int32 and np.array_equal(first, slow.intersects_first(origins, directions))
    hit = fast.intersects_any(origins, directions)
    assert hit.dtype == bool and np.array_equal(hit, slow.intersects_any(origins, directions))
    locations, index_ray, index_tri = fast.intersects_location(origins, directions)
    ids = fast.intersects_id(origins, directions)
    assert np.array_equal(ids[0], index_tri) and np.array_equal(ids[1], index_ray) and len(locations) == len(index_tri)


def test_at_most_max_hits():
    layers = trimesh.util.concatenate([trimesh.creation.box([1, 1, 1 / (k + 1)]) for k in range(6)])
    ray = kd.trimesh.RayMeshIntersector(layers)
    origins, directions = [[0.1, 0.2, 5.0]] * 2, [[0.0, 0.0, -1.0]] * 2
    assert len(ray.intersects_id(origins, directions)[0]) == 24
    for most in (0, 1, 5):
        _, index_ray, locations = ray.intersects_id(origins, directions, max_hits=most, return_locations=True)
        assert index_ray.tolist() == [0] * most + [1] * most and len(locations) == 2 * most


def test_far_origins_and_scales_take_no_precision():
    for scale in (1e-6, 1.0, 1e6):
        for shift in ([0, 0, 0], [5e5, 5.2e6, 100.0]):
            mesh = sphere(3)
            mesh.apply_scale(scale)
            mesh.apply_translation(np.multiply(shift, scale))
            center = np.multiply(shift, scale)
            rng = np.random.default_rng(5)
            direction = trimesh.unitize(rng.normal(size=(500, 3)))
            beside = trimesh.unitize(np.cross(direction, rng.normal(size=(500, 3)))) * scale
            ray = kd.trimesh.RayMeshIntersector(mesh)
            for distance in (1.5, 1e3, 1e7):
                # 3 % inside of the sphere, and 3 % outside.
                origins = center + 0.96 * beside - distance * scale * direction
                locations, index_ray, _ = ray.intersects_location(origins, direction)
                assert np.array_equal(index_ray, np.repeat(np.arange(500), 2)), (scale, shift, distance)
                radius = np.linalg.norm(locations - center, axis=1) / scale
                assert (np.abs(radius - 0.995) < 0.006).all(), (scale, shift, distance)
                assert not ray.intersects_any(origins, -direction).any()
                assert not ray.intersects_any(origins + 0.05 * beside, direction).any()


def test_a_tiny_box_from_far_away():
    mesh = trimesh.creation.box(extents=[1e-3] * 3)
    found = kd.trimesh.RayMeshIntersector(mesh).intersects_location([[1e-4, 0, 1e4]], [[0.0, 0.0, -1.0]])
    np.testing.assert_allclose(np.sort(found[0][:, 2]), [-5e-4, 5e-4], atol=1e-9)


def test_contains_points():
    mesh = sphere(3)
    points = np.random.default_rng(1).uniform(-1.2, 1.2, (3000, 3))
    radius = np.linalg.norm(points, axis=1)
    inside = kd.trimesh.RayMeshIntersector(mesh).contains_points(points)
    assert inside[radius < 0.98].all() and not inside[radius > 1.0].any()
    with pytest.raises(ValueError, match="points"):
        kd.trimesh.RayMeshIntersector(mesh).contains_points(np.zeros((4, 2)))
    # A bowl: trimesh's own way, by two rays.
    bowl = trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.triangles_center[:, 2] < 0.5])
    assert not bowl.is_watertight
    assert not kd.trimesh.RayMeshIntersector(bowl).contains_points([[0.0, 0.0, 3.0], [0.1, 0.0, 0.9]]).any()


def test_no_rays_and_no_faces():
    ray = kd.trimesh.RayMeshIntersector(sphere(1))
    none = np.zeros((0, 3))
    tri, index, locations = ray.intersects_id(none, none, return_locations=True)
    assert tri.shape == index.shape == (0,) and locations.shape == (0, 3)
    assert ray.intersects_any(none, none).shape == (0,)
    empty = kd.trimesh.RayMeshIntersector(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.zeros((0, 3), int)))
    assert empty.intersects_first([[0, 0, 1]], [[0, 0, -1]]).tolist() == [-1]
    with pytest.raises(ValueError, match="match"):
        ray.intersects_any(none, np.zeros((1, 3)))


def test_rays_that_cannot_hit():
    ray = kd.trimesh.RayMeshIntersector(sphere(1))
    odd = [np.nan, np.inf, -np.inf, 1e300]
    origins = [[x, 0.0, 0.0] for x in odd] + [[0.0, 0.0, 0.0]] * 4 + [[0.0, 0.0, 5.0]]
    directions = [[0.0, 1.0, 0.0]] * 4 + [[x, 0.0, 0.0] for x in odd[:3]] + [[0.0, 0.0, 0.0]] * 2
    assert not ray.intersects_any(origins, directions).any()
    for size in (1e-300, 1e-30, 1e30, 1e300):
        assert ray.intersects_any([[0.1, 0.2, 50.0]], [[0.0, 0.0, -size]]).all()
        assert not ray.intersects_any([[0.1, 0.2, 50.0]], [[0.0, 0.0, size]]).any()


def test_a_mesh_that_changes_gets_a_new_tree():
    mesh = sphere(2)
    mesh.ray = kd.trimesh.RayMeshIntersector(mesh)
    above, down = [[0.0, 0.0, 9.0]], [[0.01, 0.02, -1.0]]
    assert mesh.ray.intersects_location(above, down, multiple_hits=False)[0][0, 2] < 1.0
    tree = mesh.ray._tree
    assert mesh.ray._tree is tree, "kept while the mesh stays"
    mesh.apply_translation([0, 0, 3])
    assert mesh.ray.intersects_location(above, down, multiple_hits=False)[0][0, 2] > 3.0


@pytest.mark.parametrize("again", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy])
def test_pickle_and_copy(again):
    ray = kd.trimesh.RayMeshIntersector(sphere(2), scale_to_box=False)
    origins, directions = rays(100)
    expected = ray.intersects_id(origins, directions)
    other = again(ray)
    assert other._scale_to_box is False
    assert all(map(np.array_equal, other.intersects_id(origins, directions), expected))


def in_new_process(program):
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert found.returncode == 0, found.stdout + found.stderr
    return found.stdout.split()


def test_install_makes_trimesh_use_it():
    program = """
import trimesh, kd.trimesh
before = trimesh.creation.box()
kd.trimesh.install()
kd.trimesh.install()
after = trimesh.creation.box()
from trimesh.ray import ray_pyembree
import trimesh.ray.ray_pyembree
print(type(before.ray).__module__, type(after.ray).__module__, ray_pyembree.__name__)
print(after.contains([[0, 0, 0], [0, 0, 2]]).tolist() == [True, False], trimesh.Trimesh(use_embree=False).ray.__module__)
"""
    names = in_new_process(program)
    assert names[0] != "kd.trimesh" and names[1:4] == ["kd.trimesh", "kd.trimesh", "True"]
    assert names[4] == "trimesh.ray.ray_triangle"


@pytest.mark.skipif("KD_TRIMESH_SOURCE" not in os.environ, reason="KD_TRIMESH_SOURCE names no checkout of trimesh")
def test_tests_of_trimesh_pass():
    tests = Path(os.environ["KD_TRIMESH_SOURCE"], "tests")
    program = f"""
import sys, pytest, kd.trimesh
kd.trimesh.install()
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", {str(tests / "test_ray.py")!r}, {str(tests / "test_ray_upstream.py")!r}]))
"""
    assert " 30 passed" in " " + " ".join(in_new_process(program))


def test_the_wrong_vertices_are_refused():
    tree = kd.KdTree(*meshes.soup(5))
    with pytest.raises(ValueError, match="vertices: 3 rows"):
        kd._kd.Intersector(tree, np.zeros((3, 3)))
