"""Queries of points, against brute force."""

import numpy as np
import pytest

import brute
import kd
import meshes


@pytest.fixture(params=["wide", "binary"])
def sphere(request):
    vertices, faces = meshes.octasphere(3)
    return vertices, faces, kd.KdTree(vertices, faces, layout=request.param)


def points(count=700, seed=2):
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3)).astype(np.float32)


def test_closest_points(sphere):
    vertices, faces, tree = sphere
    asked = points()
    distances = brute.closest_points(vertices, faces, asked)
    closest = tree.closest_point(asked)
    np.testing.assert_allclose(closest.distance, distances.min(axis=1), rtol=1e-5, atol=1e-6)
    own = distances[np.arange(len(asked)), closest.triangle]
    np.testing.assert_allclose(own, distances.min(axis=1), rtol=1e-5, atol=1e-6)
    gap = np.linalg.norm(closest.point - asked, axis=1)
    np.testing.assert_allclose(gap, closest.distance, rtol=1e-5, atol=1e-6)
    corners = vertices[faces[closest.triangle]].astype(np.float64)
    weights = np.column_stack([1 - closest.u - closest.v, closest.u, closest.v])
    np.testing.assert_allclose((weights[..., None] * corners).sum(1), closest.point, atol=1e-5)
    on_face = closest.feature == 0
    assert set(np.unique(closest.feature)) <= set(range(7)) and on_face.any()
    assert (weights[on_face] > 0).all()


def test_closest_points_name_the_feature():
    tree = kd.KdTree(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    asked = [[0.2, 0.2, 1], [0.5, -1, 0], [1, 1, 0], [-1, 0.5, 0], [-1, -1, 0], [2, 0, 0], [0, 2, 0]]
    assert tree.closest_point(asked).feature.tolist() == [0, 1, 2, 3, 4, 5, 6]


def test_points_beyond_the_distance_have_none(sphere):
    _, _, tree = sphere
    closest = tree.closest_point([[3.0, 0, 0], [1.5, 0, 0], [np.nan, 0, 0]], max_distance=1.0)
    assert closest.triangle.tolist()[::2] == [-1, -1] and closest.triangle[1] >= 0
    assert np.isinf(closest.distance[::2]).all() and np.isnan(closest.point[::2]).all()
    assert np.isnan(closest.u[0]) and closest.feature.tolist()[::2] == [-1, -1]


def test_inside_and_signed_distance(sphere):
    vertices, faces, tree = sphere
    assert tree.is_closed
    asked = points()
    inside = np.abs(brute.winding(vertices, faces, asked) - 1) < 0.5
    assert 50 < inside.sum() < 650
    assert np.array_equal(tree.contains(asked), inside)
    distances = brute.closest_points(vertices, faces, asked).min(axis=1)
    signed = np.where(inside, -distances, distances)
    np.testing.assert_allclose(tree.signed_distance(asked), signed, rtol=1e-5, atol=1e-6)
    assert tree.contains(vertices).all(), "the surface is inside"
    assert (tree.signed_distance(vertices) == 0).all()
    assert np.isnan(tree.signed_distance([[np.nan, 0, 0]])).all()
    assert not tree.contains([[np.inf, 0, 0]]).any()


def test_winding_numbers(sphere):
    vertices, faces, tree = sphere
    asked = points()
    expected = brute.winding(vertices, faces, asked)
    np.testing.assert_allclose(tree.winding_number(asked), expected, atol=0.01)
    half = kd.KdTree(vertices, faces[::2])
    open_surface = brute.winding(vertices, faces[::2], asked)
    np.testing.assert_allclose(half.winding_number(asked), open_surface, atol=0.01)


def test_triangles_of_regions():
    vertices, faces = meshes.soup(500)
    tree = kd.KdTree(vertices, faces)
    centers = points(60, seed=9)
    distances = brute.closest_points(vertices, faces, centers)
    radii = np.linspace(0.1, 0.6, len(centers)).astype(np.float32)
    near = np.abs(distances - radii[:, None]) < 1e-6
    lists = tree.triangles_in_sphere(centers, radii)
    assert len(lists) == len(centers) and lists.counts.sum() == len(lists.triangle) > 100
    for i, row in enumerate(distances):
        if not near[i].any():
            assert np.array_equal(lists[i], np.flatnonzero(row <= radii[i]))
    all_of_it = tree.triangles_in_box([[-np.inf] * 3, [9, 9, 9]], [[np.inf] * 3, [10, 10, 10]])
    assert np.array_equal(all_of_it[0], np.arange(500)) and len(all_of_it[1]) == 0
    one = faces[123]
    corner = vertices[one[0]]
    assert 123 in tree.triangles_in_box([corner], [corner])[0], "a box of one point"
    boxes = tree.triangles_in_box(centers - 0.1, centers + 0.1)
    inside = ((vertices >= centers[:, None] - np.float32(0.1)) & (vertices <= centers[:, None] + np.float32(0.1))).all(-1)
    for i in range(len(centers)):
        with_corner = np.flatnonzero(inside[i][faces].any(axis=1))
        assert set(with_corner) <= set(boxes[i]), "a triangle with a corner in the box is in it"


def test_positions_are_those_of_the_arguments():
    far = np.array([5e5, 5.2e6, 0.0])
    vertices, faces = meshes.octasphere(2)
    vertices = np.round(vertices * 256) / 256
    tree = kd.KdTree(vertices.astype(np.float64) + far, faces)
    asked = np.array([[0.0, 0.0, 3.0]]) + far
    closest = tree.closest_point(asked)
    assert np.array_equal(closest.point, [[5e5, 5.2e6, 1.0]]) and closest.distance[0] == 2.0
    assert tree.contains(far[None])[0] and tree.signed_distance(far[None])[0] < -0.5
    assert len(tree.triangles_in_sphere(asked, 2.0)[0]) == 4
