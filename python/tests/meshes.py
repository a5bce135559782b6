"""Meshes for tests."""

import numpy as np

CUBE_VERTICES = np.array(
    [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)], dtype=np.float32
)
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5],
        [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
        [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.int32,
)  # fmt: skip


def soup(triangles, seed=0, size=0.2):
    """Random triangles in a box of side 2."""
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-1, 1, (triangles, 1, 3))
    vertices = centers + rng.uniform(-size, size, (triangles, 3, 3))
    faces = np.arange(3 * triangles).reshape(-1, 3)
    return vertices.reshape(-1, 3).astype(np.float32), faces


def octasphere(levels):
    """A closed sphere of ``8 * 4**levels`` triangles, counter-clockwise from outside, with float32 vertices."""
    vertices = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    vertices = [tuple(map(float, v)) for v in vertices]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        middles, finer = {}, []
        for face in faces:
            mids = []
            for i in range(3):
                key = tuple(sorted((face[i], face[(i + 1) % 3])))
                if key not in middles:
                    middles[key] = len(vertices)
                    middle = np.add(vertices[key[0]], vertices[key[1]])
                    vertices.append(tuple(middle / np.linalg.norm(middle)))
                mids.append(middles[key])
            a, b, c = face
            ab, bc, ca = mids
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return np.array(vertices, np.float32), np.array(faces)


def rays(count, seed=0):
    """Random rays between points of a box of side 3."""
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(-1.5, 1.5, (2, count, 3)).astype(np.float32)
    return start, end - start
