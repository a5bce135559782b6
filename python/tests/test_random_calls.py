"""Random calls, good and bad: an exception of a kind that is documented, or an answer of the right shape, never the end of the interpreter.

`KD_RANDOM_CALLS` is the number of calls, 3000 by default. `.ci/python --long` makes 100 000 in a build with checks.
"""

import os

import numpy as np

import kd
import kd._kd
import kd.open3d
import meshes

CALLS = int(os.environ.get("KD_RANDOM_CALLS", "3000"))
#: What a call may raise.
EXPECTED = (ValueError, TypeError, OverflowError, IndexError, MemoryError, OSError)


class Strange:
    """An object that is no array, and says so loudly."""

    def __array__(self, *_, **__):
        raise RuntimeError("no array")


def numbers(rng, shape):
    kinds = [
        lambda: rng.uniform(-2, 2, shape),
        lambda: rng.integers(-3, 4, shape),
        lambda: rng.choice([0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 1e-45, 1e38, 1e300, -1e-300], shape),
        lambda: rng.uniform(-2, 2, shape) * 10.0 ** rng.integers(-45, 39),
    ]
    return kinds[rng.integers(len(kinds))]()


def array(rng, rows, columns=3):
    shape = (rows, columns) if columns else (rows,)
    if rng.random() < 0.08:
        shape = tuple(rng.integers(0, 5, rng.integers(0, 4)))
    with np.errstate(all="ignore"):
        made = np.asarray(numbers(rng, shape)).astype(
            rng.choice(["f4", "f8", "f4", "f8", "f2", "i4", "i8", "u1", ">f4", "g", "?", "c8", "O", "S3", "U2", "M8[s]"],
                       p=[0.3, 0.3, 0.08, 0.08] + [0.02] * 12)
        )  # fmt: skip
    forms = [
        lambda a: a, lambda a: a, lambda a: a, lambda a: a.tolist(), np.asfortranarray, lambda a: a[::-1],
        lambda a: np.repeat(a, 2, axis=0)[::2] if a.ndim else a, lambda a: a[..., ::-1],
        lambda a: np.broadcast_to(a[:1], a.shape) if a.ndim else a, lambda a: a.T,
        lambda a: np.ma.masked_array(a), lambda a: memoryview(np.ascontiguousarray(a)) if a.dtype.kind == "f" else a,
    ]  # fmt: skip
    return random_of(rng, forms)(made)


def random_of(rng, values):
    return values[rng.integers(len(values))]


def anything(rng):
    return random_of(rng, [None, 0, -1, 1.5, "x", b"y", [], {}, Strange(), object(), np.nan, 2**70, [[]], np.array(3), np.zeros((2, 3, 1))])


def rows_argument(rng, rows, columns=3):
    if rng.random() < 0.03:
        return anything(rng)
    return array(rng, rows, columns)


def build(rng):
    if rng.random() < 0.6:
        vertices, faces = meshes.soup(int(rng.integers(0, 60)), int(rng.integers(100)))
        vertices = vertices.astype(random_of(rng, ["f4", "f8"]))
    else:
        vertices = rows_argument(rng, int(rng.integers(0, 20)))
        faces = rng.integers(-1, 20, (int(rng.integers(0, 20)), 3)).astype(random_of(rng, ["i1", "u4", "i8", "u8", "f8"]))
        if rng.random() < 0.1:
            faces = anything(rng)
    options = {}
    if rng.random() < 0.3:
        options["preset"] = random_of(rng, ["fast", "best", "balanced", "", None, 3])
    if rng.random() < 0.3:
        options["layout"] = random_of(rng, ["wide", "binary", "deep"])
    if rng.random() < 0.3:
        options["threads"] = random_of(rng, [None, 1, 2, 3, 0, -1, 1.0])
    if rng.random() < 0.1:
        options["progress"] = random_of(rng, [lambda _: None, 5, lambda: None])
    return kd.KdTree(vertices, faces, **options)


def rows_of(argument):
    return 1 if np.shape(argument) == (3,) else np.shape(argument)[0]


def ask_rays(rng, tree):
    rows = int(rng.choice([0, 1, 2, 17, 300]))
    origins, directions = rows_argument(rng, rows), rows_argument(rng, rows)
    options = {}
    for name in ("t_min", "t_max"):
        if rng.random() < 0.3:
            options[name] = rows_argument(rng, rows, 0) if rng.random() < 0.5 else float(numbers(rng, ()))
    if rng.random() < 0.2:
        options["culling"] = random_of(rng, [None, "back", "front", "both", 7])
    if rng.random() < 0.2:
        options["mask"] = random_of(rng, [0, 1, -1, 2**32 - 1, 2**32, rng.integers(0, 9, rows), None, 1.5])
    name = random_of(rng, ["intersect", "occluded", "hits", "count_hits", "crossings"])
    if isinstance(tree, kd.Frame) and name == "crossings":
        name = "hits"
    if name in ("hits", "crossings") and rng.random() < 0.5:
        options["max"] = random_of(rng, [0, 1, 3, None, -1, 2**63, 2**64])
    answer = getattr(tree, name)(origins, directions, **options)
    assert len(answer) == np.broadcast_shapes((rows_of(origins),), (rows_of(directions),))[0]
    if name in ("hits", "crossings"):
        assert answer.offsets[-1] == len(answer.t) == len(answer.ray)
        if len(answer):
            assert len(answer[int(rng.integers(-len(answer), len(answer)))]) >= 0
    return answer


def ask_points(rng, tree):
    rows = int(rng.choice([0, 1, 5, 300]))
    points = rows_argument(rng, rows)
    name = random_of(rng, ["closest_point", "contains", "signed_distance", "winding_number", "triangles_in_box", "triangles_in_sphere"])
    if isinstance(tree, kd.Frame) and name == "winding_number":
        name = "contains"
    if name == "closest_point" and rng.random() < 0.5:
        return tree.closest_point(points, random_of(rng, [0.0, -1.0, 0.5, np.nan, np.inf, 1e300, "far"]))
    if name == "triangles_in_box":
        return tree.triangles_in_box(points, rows_argument(rng, rows))
    if name == "triangles_in_sphere":
        return tree.triangles_in_sphere(points, rows_argument(rng, rows, 0) if rng.random() < 0.5 else 0.5)
    return getattr(tree, name)(points)


def ask_intersector(rng, tree):
    rows = int(rng.choice([0, 1, 2, 300]))
    vertices = tree.vertices if rng.random() < 0.9 else rows_argument(rng, len(tree))
    rays = kd._kd.Intersector(tree, vertices)
    origins, directions = rows_argument(rng, rows), rows_argument(rng, rows)
    call = random_of(rng, [
        rays.first, rays.any,
        lambda o, d: rays.all(o, d, rng.random() < 0.5, int(rng.integers(0, 5)), rng.random() < 0.5),
    ])  # fmt: skip
    return call(origins, directions)


def ask_open3d(rng):
    scene = kd.open3d.RaycastingScene(int(rng.integers(0, 3)))
    for _ in range(int(rng.integers(0, 3))):
        if rng.random() < 0.7:
            scene.add_triangles(*meshes.soup(int(rng.integers(0, 9)), int(rng.integers(100))))
        else:
            faces = rng.integers(-1, 9, (4, 3)).astype(random_of(rng, ["i1", "u8", "f4"]))
            scene.add_triangles(rows_argument(rng, 9), faces)
    rays = rows_argument(rng, int(rng.integers(0, 300)), 6)
    name = random_of(rng, ["cast_rays", "test_occlusions", "count_intersections", "list_intersections"])
    if rng.random() < 0.6:
        return getattr(scene, name)(rays, nthreads=random_of(rng, [0, 1, 2, -1, None]))
    name = random_of(rng, ["compute_closest_points", "compute_distance", "compute_signed_distance", "compute_occupancy"])
    return getattr(scene, name)(rows_argument(rng, int(rng.integers(0, 300))))


def change(rng, scene):
    """Changes a scene somehow, commits now and then, and asks its frame."""
    part = random_of(rng, [0, 1, 2, 3, int(rng.integers(0, 30)), -1, 1.5])
    transform = random_of(rng, [np.eye(4), rng.normal(size=(3, 4)), np.diag([1, -1, 0, 1]), numbers(rng, (3, 4)), numbers(rng, (4, 4))])
    few = meshes.soup(int(rng.integers(0, 9)), int(rng.integers(100)))
    kind = random_of(rng, ["add", "instance", "move", "move", "vertices", "mask", "remove", "strategy", "commit", "commit", "mesh", "ask", "ask"])
    if kind == "add" and len(scene.parts) < 8:
        add = random_of(rng, [scene.add_static, scene.add_dynamic])
        vertices = few[0] if rng.random() < 0.8 else rows_argument(rng, len(few[0]))
        add(vertices, few[1], *([transform] if rng.random() < 0.4 else []))
    elif kind == "instance" and len(scene.parts) < 8:
        scene.add_instance(part, transform)
    elif kind == "move":
        scene.set_transform(part, transform if rng.random() < 0.9 else anything(rng))
    elif kind == "vertices":
        scene.set_vertices(part, few[0] if rng.random() < 0.8 else rows_argument(rng, 9))
    elif kind == "mask":
        scene.set_mask(part, random_of(rng, [0, 1, 2**32 - 1, -1]))
    elif kind == "remove":
        scene.remove(part)
    elif kind == "strategy":
        scene.set_strategy(random_of(rng, ["auto", "merge", "refit", "instances", "dual", "rebuild", "x"]))
    elif kind == "commit":
        scene.commit()
    elif kind == "mesh":
        scene.frame.mesh(part)
    elif rng.random() < 0.5:
        ask_rays(rng, scene.frame)
    else:
        ask_points(rng, scene.frame)


def test_random_calls():
    scene = kd.Scene("fast")
    trees = [kd.KdTree(*meshes.soup(40)), kd.KdTree(*meshes.octasphere(1))]
    answered = refused = 0
    for seed in range(CALLS):
        rng = np.random.default_rng(seed)
        try:
            if seed % 500 == 0:
                scene = kd.Scene("fast", threads=random_of(rng, [None, 1]))
            kind = rng.random()
            if kind < 0.2:
                trees[int(rng.integers(len(trees)))] = build(rng)
            elif kind < 0.45:
                ask_rays(rng, random_of(rng, trees))
            elif kind < 0.6:
                ask_points(rng, random_of(rng, trees))
            elif kind < 0.8:
                change(rng, scene)
            elif kind < 0.9:
                ask_open3d(rng)
            else:
                ask_intersector(rng, random_of(rng, trees))
            answered += 1
        except EXPECTED:
            refused += 1
        except RuntimeError as error:
            # That of `Strange`, from where NumPy is asked first.
            assert str(error) == "no array"
            refused += 1
    assert answered > CALLS / 4 and refused > CALLS / 20, (answered, refused)
