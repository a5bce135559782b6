"""Hits on a lattice, against exact arithmetic: most rays pass through edges and corners."""

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import kd

COORDINATE = st.integers(-3, 3)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
#: The largest component is a power of two, so that the float32 test has nothing to round.
DIRECTION = st.tuples(*[st.integers(-2, 2)] * 3)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def exact_hit(corners, origin, direction):
    """`t` of the hit, or None: closed triangles, not those that are seen edge-on."""
    a, b, c = (minus(corner, origin) for corner in corners)
    volumes = [dot(direction, cross(x, y)) for x, y in ((b, c), (c, a), (a, b))]
    total = sum(volumes)
    if total == 0 or (min(volumes) < 0 < max(volumes)):
        return None
    normal = cross(minus(b, a), minus(c, a))
    return Fraction(dot(a, normal), dot(direction, normal))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(POINT, POINT, POINT), min_size=1, max_size=12),
    st.lists(st.tuples(POINT, DIRECTION), min_size=1, max_size=30),
    st.sampled_from(["wide", "binary"]),
    st.integers(-1, 1),
)
def test_hits_are_exact(triangles, rays, layout, t_min):
    vertices = np.array(triangles, np.float32).reshape(-1, 3)
    tree = kd.KdTree(vertices, np.arange(len(vertices)).reshape(-1, 3), layout=layout)
    origins, directions = (np.array(rows, np.float32) for rows in zip(*rays))
    lists = tree.hits(origins, directions, t_min=t_min)
    closest = tree.intersect(origins, directions, t_min=t_min)
    occluded = tree.occluded(origins, directions, t_min=t_min)
    for i, (origin, direction) in enumerate(rays):
        expected = []
        for number, corners in enumerate(triangles):
            t = exact_hit(corners, origin, direction)
            if t is not None and t >= t_min:
                expected.append((float(np.float32(float(t))), number))
        expected.sort()
        assert list(zip(lists[i].t.tolist(), lists[i].triangle.tolist())) == expected
        assert occluded[i] == bool(expected)
        first = expected[0] if expected else (np.inf, -1)
        assert (closest.t[i], closest.triangle[i]) == first


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(POINT, POINT, POINT, POINT), min_size=1, max_size=6),
    st.lists(st.tuples(POINT, DIRECTION), min_size=1, max_size=30),
)
def test_solids_are_crossed_an_even_number_of_times(solids, rays):
    vertices = np.array(solids, np.float32).reshape(-1, 3)
    of_one = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    # Flat solids have faces of no area, which nothing hits, beside others that are hit: they are no closed surface.
    areas = [[np.any(cross(minus(s[b], s[a]), minus(s[c], s[a]))) for a, b, c in of_one] for s in solids]
    faces = np.concatenate([of_one + 4 * k for k, own in enumerate(areas) if all(own)] or [np.zeros((0, 3), int)])
    tree = kd.KdTree(vertices, faces)
    origins, directions = (np.array(rows, np.float32) for rows in zip(*rays))
    # A whole line begins and ends outside.
    counts = tree.crossings(origins, directions, t_min=-np.inf).counts
    assert ((counts > 0) == tree.occluded(origins, directions, t_min=-np.inf)).all()
    for count, (origin, direction) in zip(counts, rays):
        corners = ([minus(vertices[i].astype(int).tolist(), origin) for i in face] for face in faces)
        runs_in_a_face = any(dot(direction, cross(a, b)) == 0 == dot(direction, cross(b, c)) for a, b, c in corners)
        assert count % 2 == 0 or runs_in_a_face
