"""Every triangle, one by one, in float64: written without the library, to compare with."""

import numpy as np


def all_hits(vertices, faces, origins, directions):
    """Arrays ``t``, ``u``, ``v`` and ``margin`` of shape (rays, triangles).

    ``margin`` is the least of the three weights: the ray hits the triangle where it is positive, and misses it where it is negative. Near
    zero, or where it is NaN, this computation cannot tell.
    """
    a, b, c = (np.asarray(vertices, np.float64)[np.asarray(faces)[:, k]] for k in range(3))
    o = np.asarray(origins, np.float64)[:, None]
    d = np.asarray(directions, np.float64)[:, None]
    ab, ac = b - a, c - a
    p = np.cross(d, ac)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (ab * p).sum(-1)
        s = o - a
        u = (s * p).sum(-1) * scale
        q = np.cross(s, ab)
        v = (d * q).sum(-1) * scale
        t = (ac * q).sum(-1) * scale
        margin = np.minimum(np.minimum(u, v), 1.0 - u - v)
    return t, u, v, margin


def closest_points(vertices, faces, points):
    """The distance of each point from each triangle: shape (points, triangles)."""
    corners = [np.asarray(vertices, np.float64)[np.asarray(faces)[:, k]] for k in range(3)]
    p = np.asarray(points, np.float64)[:, None]
    best = np.full((len(p), len(corners[0])), np.inf)
    for k in range(3):
        start, end = corners[k], corners[(k + 1) % 3]
        along = end - start
        with np.errstate(divide="ignore", invalid="ignore"):
            at = ((p - start) * along).sum(-1) / (along * along).sum(-1)
        at = np.clip(np.nan_to_num(at), 0.0, 1.0)[..., None]
        best = np.minimum(best, np.linalg.norm(p - (start + at * along), axis=-1))
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    height = ((p - corners[0]) * normal).sum(-1)
    foot = p - height[..., None] * normal
    inside = np.ones_like(best, dtype=bool)
    for k in range(3):
        edge = corners[(k + 1) % 3] - corners[k]
        inside &= (np.cross(edge, foot - corners[k]) * normal).sum(-1) >= 0.0
    return np.where(inside, np.minimum(best, np.abs(height)), best)


def winding(vertices, faces, points):
    """The winding number of each point, as the sum of solid angles (Van Oosterom and Strackee 1983)."""
    a, b, c = (
        np.asarray(vertices, np.float64)[np.asarray(faces)[:, k]] - np.asarray(points)[:, None]
        for k in range(3)
    )
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    top = (a * np.cross(b, c)).sum(-1)
    bottom = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return (2.0 * np.arctan2(top, bottom)).sum(-1) / (4.0 * np.pi)
