"""Crossings: hits at edges and corners, counted once."""

import numpy as np
import pytest

import kd
import meshes


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.0), (0.1, 0.05, 0.02), (0.25, 0.5, -0.25)])
def test_a_sphere_is_left_once_through_vertices_and_edges(eye):
    vertices, faces = meshes.octasphere(5)
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    targets = np.vstack([vertices, vertices[edges].mean(axis=1)]).astype(np.float32)
    directions = targets - np.float32(eye)
    tree = kd.KdTree(vertices, faces)
    assert (tree.crossings(eye, directions).counts == 1).all()
    assert (tree.count_hits(eye, directions) > 1).any(), "some are exactly on an edge"
    from_outside = tree.crossings(targets + 3 * directions, -directions)
    assert (from_outside.counts == 2).all()


def test_first_crossings_are_closest_hits():
    tree = kd.KdTree(*meshes.octasphere(3))
    origins, directions = meshes.rays(4000, seed=8)
    closest = tree.intersect(origins, directions)
    first = tree.crossings(origins, directions, max=1)
    assert np.array_equal(first.counts, closest.hit.astype(int))
    assert np.array_equal(first.t, closest.t[closest.hit])
    lists = tree.crossings(origins, directions)
    assert np.array_equal(lists.counts, tree.count_hits(origins, directions)), "off all edges"


def test_a_cube_through_corners_edges_and_ridges():
    tree = kd.KdTree(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    for origin, direction, count, what in [
        ((-1, -1, -1), (1, 1, 1), 2, "from corner to corner"),
        ((0.5, -1, -1), (0, 1, 1), 2, "from edge to edge"),
        ((0.5, 0.5, 5), (0, 0, -1), 2, "on both diagonals"),
        ((-1, 0.5, 1.5), (1, 0, -1), 2, "touches a ridge from outside, once for each side"),
        ((0.5, 0.5, 0.5), (1, 1, 1), 1, "from inside through a corner"),
        ((0.5, 0.5, 0.5), (0, 1, 1), 1, "from inside through an edge"),
    ]:
        found = tree.crossings([origin], [direction])
        assert found.counts[0] % 2 == count % 2, what
        assert found.counts[0] <= count and len(np.unique(found.t)) <= found.counts[0], what
        assert found.counts[0] > 0 and tree.count_hits([origin], [direction])[0] >= found.counts[0], what


def test_nothing_that_is_hit_is_lost_at_a_rim():
    # Two triangles of a square: rays through the ends and the middle of the diagonal, and through the rim.
    square = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    tree = kd.KdTree(square, [[0, 1, 2], [0, 2, 3]])
    through = np.float32([[0, 0, 1], [1, 1, 1], [0.5, 0.5, 1], [0.5, 0, 1], [0, 0.5, 1], [1, 0, 1]])
    found = tree.crossings(through, [0, 0, -1])
    assert found.counts.tolist() == [1] * 6
    assert tree.count_hits(through, [0, 0, -1]).tolist() == [2, 2, 2, 1, 1, 1]


def test_coincident_triangles_count_one_by_one():
    square = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]] * 3)
    tree = kd.KdTree(square, faces)
    inside = np.float32([[0.75, 0.25, 1], [0.25, 0.75, 1], [0.5, 0.5, 1]])
    assert tree.crossings(inside, [0, 0, -1]).counts.tolist() == [3, 3, 3], "on the diagonal, too"


def test_vertices_need_not_be_merged():
    vertices, faces = meshes.octasphere(3)
    loose = kd.KdTree(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert (loose.crossings([0, 0, 0], vertices).counts == 1).all()


def test_an_even_number_from_outside_to_outside():
    # Shapes on a lattice, and rays on it: most pass through edges and corners.
    vertices, faces = meshes.CUBE_VERTICES, meshes.CUBE_FACES
    all_vertices, all_faces = [], []
    for k, shift in enumerate([(0, 0, 0), (1, 0, 0), (0, 1, 1), (2, 2, 0), (1, 1, 1)]):
        all_vertices.append(vertices + np.float32(shift))
        all_faces.append(faces + 8 * k)
    tree = kd.KdTree(np.vstack(all_vertices), np.vstack(all_faces))
    # No ray runs in the plane of a face.
    rng = np.random.default_rng(4)
    direction = rng.choice([-2, -1, 1, 2], (4000, 3)).astype(np.float32)
    target = rng.integers(0, 7, direction.shape) / np.float32(2)
    found = tree.crossings(target - 8 * direction, direction)
    assert found.counts.max() >= 4 and len(found.t) > 5000 and (found.counts % 2 == 0).all()
    assert (tree.count_hits(target - 8 * direction, direction) != found.counts).sum() > 500
