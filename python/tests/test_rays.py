"""Queries of rays, against brute force."""

import numpy as np
import pytest

import brute
import kd
import meshes

LAYOUTS = ["wide", "binary"]
#: Weights nearer to an edge than this may be called either way by the brute force.
UNSURE = 1e-5


def counted(brute_hits, t_min, t_max):
    """Which triangles each ray surely hits, and which rays have nothing that is unsure."""
    t, _, _, margin = brute_hits
    near_an_end = (np.abs(t - t_min) < 1e-5) | (np.abs(t - t_max) < 1e-5)
    # NaN is a triangle that is seen edge-on, or has no area.
    unsure = (np.abs(margin) < UNSURE) | np.isnan(margin) | (near_an_end & (margin > -UNSURE))
    hits = (margin > 0) & (t >= t_min) & (t <= t_max)
    return hits, ~unsure.any(axis=1)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("preset", ["fast", "balanced", "best"])
@pytest.mark.parametrize("limits", [(0.0, np.inf), (0.25, 0.75), (-1.0, 0.5)])
def test_queries_equal_brute_force(layout, preset, limits):
    vertices, faces = meshes.soup(400, size=0.4)
    origins, directions = meshes.rays(1500, seed=3)
    tree = kd.KdTree(vertices, faces, preset=preset, layout=layout)
    t_min, t_max = limits
    expected = brute.all_hits(vertices, faces, origins, directions)
    hits, sure = counted(expected, t_min, t_max)
    assert sure.sum() > 1300 and hits.any(axis=1).sum() > 500, "most rays can be judged"
    t = np.where(hits, expected[0], np.inf)
    rows = np.flatnonzero(sure)

    closest = tree.intersect(origins, directions, t_min, t_max)
    assert np.array_equal(closest.hit[rows], hits[rows].any(axis=1))
    assert np.array_equal(
        closest.triangle[rows], np.where(hits[rows].any(axis=1), t[rows].argmin(axis=1), -1)
    )
    met = rows[closest.hit[rows]]
    triangle = closest.triangle[met]
    np.testing.assert_allclose(closest.t[met], t[met].min(axis=1), rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(closest.u[met], expected[1][met, triangle], atol=1e-4)
    np.testing.assert_allclose(closest.v[met], expected[2][met, triangle], atol=1e-4)
    missed = ~closest.hit
    assert np.isinf(closest.t[missed]).all() and (closest.triangle[missed] == -1).all()
    assert np.isnan(closest.u[missed]).all() and np.isnan(closest.v[missed]).all()

    occluded = tree.occluded(origins, directions, t_min, t_max)
    assert np.array_equal(occluded, closest.hit), "the same for every ray, sure or not"
    counts = tree.count_hits(origins, directions, t_min, t_max)
    assert np.array_equal(counts[rows], hits[rows].sum(axis=1))

    lists = tree.hits(origins, directions, None, t_min, t_max)
    assert np.array_equal(lists.counts, counts) and len(lists) == len(origins)
    assert np.array_equal(lists.ray, np.repeat(np.arange(len(origins)), counts))
    for row in rows[:300]:
        ordered = np.argsort(t[row], kind="stable")[: counts[row]]
        assert np.array_equal(np.sort(lists[row].triangle), np.sort(ordered))
        assert (np.diff(lists[row].t) >= 0).all()
    first = tree.hits(origins, directions, 1, t_min, t_max)
    assert np.array_equal(first.counts, closest.hit.astype(int))
    assert np.array_equal(first.triangle, closest.triangle[closest.hit])


def test_presets_and_layouts_answer_alike():
    vertices, faces = meshes.octasphere(4)
    origins, directions = meshes.rays(5000, seed=1)
    answers = []
    for preset in ("fast", "balanced", "best"):
        for layout in LAYOUTS:
            tree = kd.KdTree(vertices, faces, preset, layout)
            hits = tree.intersect(origins, directions)
            answers.append(np.column_stack([hits.t, hits.triangle, hits.u, hits.v]).tobytes())
    assert len(set(answers)) == 1


def test_culling_sees_one_side():
    vertices, faces = meshes.octasphere(3)
    tree = kd.KdTree(vertices, faces)
    out = np.array([[0.1, 0.2, 0.9]], np.float32)
    inside = [[0.0, 0.0, 0.0]]
    assert tree.occluded(inside, out).all()
    assert not tree.occluded(inside, out, culling="back").any(), "only backs from inside"
    assert tree.occluded(inside, out, culling="front").all()
    from_outside = 5 * out
    fronts = tree.intersect(from_outside, -out, culling="back")
    backs = tree.intersect(from_outside, -out, culling="front")
    assert fronts.t[0] < backs.t[0]


def test_masks_and_ranges_of_each_ray():
    tree = kd.KdTree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    origins = np.tile([0.25, 0.25, 1.0], (4, 1))
    down = [0.0, 0.0, -1.0]
    assert tree.occluded(origins, down, mask=[1, 0, 2**32 - 1, 0]).tolist() == [True, False, True, False]
    assert tree.occluded(origins, down, mask=np.uint8(0)).tolist() == [False] * 4
    assert tree.occluded(origins, down, t_min=[0.0, 1.0, 1.5, np.nan]).tolist() == [True, True, False, False]
    assert tree.occluded(origins, down, t_max=np.array([0.5, 1, 2, -1])).tolist() == [False, True, True, False]
    assert tree.count_hits(origins, down, t_min=0.5, t_max=1).tolist() == [1] * 4


def test_rays_that_cannot_hit_are_misses():
    tree = kd.KdTree(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    odd = [np.nan, np.inf, -np.inf]
    origins = [[x, 0.5, 0.5] for x in odd] + [[0.5, 0.5, 0.5]] * 4
    directions = [[1.0, 0.0, 0.0]] * 3 + [[x, 0.0, 0.0] for x in odd] + [[0.0, 0.0, 0.0]]
    assert not tree.occluded(origins, directions).any()
    assert not tree.intersect(origins, directions).hit.any()
    assert len(tree.hits(origins, directions).t) == 0
    assert (tree.count_hits(origins, directions) == 0).all()


def test_float64_far_from_zero_is_as_exact_as_near():
    vertices, faces = meshes.soup(500)
    # Offsets that float32 holds, at places that it does not.
    vertices = np.round(vertices * 1024) / 1024
    origins, directions = meshes.rays(2000, seed=5)
    origins = np.round(origins * 1024) / 1024
    near = kd.KdTree(vertices.astype(np.float32), faces).intersect(origins, directions)
    far = np.array([5e5, 5.2e6, -3e5])
    tree = kd.KdTree(vertices.astype(np.float64) + far, faces)
    assert tree.rounding == [0.0, 0.0, 0.0] and tree.origin != [0.0, 0.0, 0.0]
    found = tree.intersect(origins.astype(np.float64) + far, directions)
    assert np.array_equal(found.triangle, near.triangle) and np.array_equal(found.t, near.t)
    assert np.array_equal(tree.vertices, vertices.astype(np.float64) + far)


def test_float32_vertices_are_taken_as_they_are():
    vertices, faces = meshes.soup(10)
    tree = kd.KdTree(vertices, faces)
    assert tree.origin == [0.0, 0.0, 0.0] and tree.rounding == [0.0, 0.0, 0.0]
    assert np.array_equal(tree.vertices, vertices) and tree.vertices.dtype == np.float64
    assert np.array_equal(tree.faces, faces) and tree.faces.dtype == np.uint32


def test_many_rays_cross_the_limits_of_chunks():
    tree = kd.KdTree(*meshes.octasphere(1))
    n = 300_001
    directions = np.broadcast_to(np.float32([0.3, 0.2, 0.1]), (n, 3)).copy()
    directions[::2] *= -1
    directions[::3] = 0
    hits = tree.intersect([0, 0, 0], directions)
    expected = tree.intersect([[0, 0, 0]] * 6, directions[:6])
    for name in ("t", "triangle", "u", "v"):
        wanted = np.resize(getattr(expected, name), n)
        assert np.array_equal(getattr(hits, name), wanted, equal_nan=True), name
    lists = tree.hits([0, 0, 0], directions)
    assert np.array_equal(lists.counts, hits.hit.astype(int))
    assert np.array_equal(lists.triangle, hits.triangle[hits.hit])
