"""Scenes: parts that move, against trees over the same triangles."""

import numpy as np
import pytest

import kd
import meshes

STRATEGIES = ["auto", "merge", "refit", "instances", "dual", "rebuild"]


def moved(vertices, matrix):
    return (vertices.astype(np.float64) @ np.asarray(matrix)[:3, :3].T + np.asarray(matrix)[:3, 3]).astype(np.float32)


def translation(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def check(frame, parts):
    """Answers of a frame are those of one tree over all parts: a list of (number, vertices, faces)."""
    vertices = np.vstack([v for _, v, _ in parts])
    starts = np.cumsum([0] + [len(v) for _, v, _ in parts])
    faces = np.vstack([f + s for (_, _, f), s in zip(parts, starts)])
    owner = np.concatenate([np.full(len(f), number) for number, _, f in parts])
    row = np.concatenate([np.arange(len(f)) for _, _, f in parts])
    tree = kd.KdTree(vertices, faces)
    origins, directions = meshes.rays(3000, seed=11)
    one, all_parts = tree.intersect(origins, directions), frame.intersect(origins, directions)
    assert one.hit.sum() > 100
    assert np.array_equal(one.t, all_parts.t) and np.array_equal(one.u, all_parts.u, equal_nan=True)
    assert np.array_equal(all_parts.part, np.where(one.hit, owner[one.triangle], -1))
    assert np.array_equal(all_parts.triangle, np.where(one.hit, row[one.triangle], -1))
    assert np.array_equal(frame.occluded(origins, directions), one.hit)
    assert np.array_equal(frame.count_hits(origins, directions), tree.count_hits(origins, directions))
    ours, lists = frame.hits(origins, directions, 3), tree.hits(origins, directions, 3)
    assert np.array_equal(ours.offsets, lists.offsets) and np.array_equal(ours.t, lists.t)
    assert np.array_equal(ours.part, owner[lists.triangle]) and np.array_equal(ours[5].part, owner[lists[5].triangle])
    points = origins[:300]
    near, expected = frame.closest_point(points), tree.closest_point(points)
    assert np.array_equal(near.point, expected.point) and np.array_equal(near.distance, expected.distance)
    assert np.array_equal(near.part, owner[expected.triangle]) and np.array_equal(near.triangle, row[expected.triangle])
    assert np.array_equal(frame.contains(points), tree.contains(points))
    assert np.array_equal(frame.signed_distance(points), tree.signed_distance(points))
    assert np.allclose(frame.winding_number(points), tree.winding_number(points), rtol=0, atol=0.02)
    for ours, lists in [
        (frame.triangles_in_sphere(points, 0.2), tree.triangles_in_sphere(points, 0.2)),
        (frame.triangles_in_box(points - 0.1, points + 0.1), tree.triangles_in_box(points - 0.1, points + 0.1)),
    ]:
        assert np.array_equal(ours.offsets, lists.offsets) and len(ours.triangle) > 0
        assert np.array_equal(ours.part, owner[lists.triangle]) and np.array_equal(ours.triangle, row[lists.triangle])


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("threads", [1, None])
def test_parts_move_change_and_go(strategy, threads):
    scene = kd.Scene("fast", strategy, threads=threads)
    walls, ball, cube = meshes.soup(300, 1), meshes.octasphere(2), (meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    a = scene.add_static(*walls)
    b = scene.add_dynamic(*ball)
    c = scene.add_dynamic(*cube, transform=translation(-0.5, -0.5, 0.25))
    d = scene.add_instance(c, translation(0.25, -1.0, 0.0))
    assert [a, b, c, d] == [0, 1, 2, 3] == scene.parts and scene.strategy == strategy
    assert scene.frame.parts == [] and not scene.frame.occluded([[0, 0, 5]], [[0, 0, -1]]).any()
    report = scene.commit()
    assert (report["parts"], report["triangles"]) == (4, 300 + 128 + 12 + 12)
    assert {change["part"] for change in report["changes"]} == {0, 1, 2, 3}
    assert "4 parts" in report["text"] and report["bytes"] > 0
    frame = scene.frame
    cubes = [(c, moved(cube[0], translation(-0.5, -0.5, 0.25)), cube[1]), (d, moved(cube[0], translation(0.25, -1, 0)), cube[1])]
    parts = [(a, *walls), (b, *ball), *cubes]
    check(frame, parts)

    turned = np.array([[0, -1, 0, 0.5], [1, 0, 0, 0], [0, 0, 0.5, -0.25]])
    scene.set_transform(b, turned)
    scene.set_vertices(c, cube[0] * np.float32(1.5))
    assert scene.commit()["changes"]
    larger = cube[0] * np.float32(1.5)
    check(scene.frame, [
        (a, *walls), (b, moved(ball[0], turned), ball[1]),
        (c, moved(larger, translation(-0.5, -0.5, 0.25)), cube[1]), (d, moved(larger, translation(0.25, -1, 0)), cube[1]),
    ])  # fmt: skip
    check(frame, parts)  # The frame before stays as it was.

    scene.remove(a)
    scene.remove(c)
    scene.commit()
    assert scene.frame.parts == scene.parts == [1, 3]
    check(scene.frame, [(b, moved(ball[0], turned), ball[1]), (d, moved(larger, translation(0.25, -1, 0)), cube[1])])
    vertices, faces = scene.frame.mesh(d)
    assert np.array_equal(vertices, moved(larger, translation(0.25, -1, 0))) and np.array_equal(faces, cube[1])


def test_masks_of_parts():
    scene = kd.Scene()
    near = scene.add_static(np.float32([[0, 0, 1], [1, 0, 1], [0, 1, 1]]), [[0, 1, 2]])
    far = scene.add_static(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    scene.set_mask(near, 0b01)
    scene.commit()
    ray = [[0.25, 0.25, 5.0]] * 3, [[0.0, 0.0, -1.0]] * 3
    assert scene.frame.intersect(*ray, mask=[0b01, 0b10, 0]).part.tolist() == [near, far, -1]
    assert scene.frame.count_hits(*ray, mask=[0b11, 0b10, 0]).tolist() == [2, 1, 0]


def test_large_worlds():
    ground = np.array([5e5, 5.2e6, 0.0])
    scene = kd.Scene(origin=ground)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    faces = [[0, 1, 2], [0, 2, 3]]
    floor = scene.add_static(square + ground, faces)
    lift = scene.add_dynamic(square.astype(np.float32), faces, translation(*ground))
    for height in (10.0, 20.5):
        scene.set_transform(lift, translation(*(ground + [0, 0, height])))
        scene.commit()
        origin = [ground + [0.75, 0.25, 80.0]]
        lists = scene.frame.hits(origin, [[0.0, 0.0, -1.0]])
        assert lists.t.tolist() == [80.0 - height, 80.0] and lists.part.tolist() == [lift, floor]
    vertices, _ = scene.frame.mesh(floor)
    assert np.array_equal(vertices, square + ground)
    copy = scene.add_instance(floor, translation(2, 0, 0))
    scene.commit()
    assert np.array_equal(scene.frame.mesh(copy)[0], square + ground + [2, 0, 0])


REFUSED = [
    (lambda s: s.set_transform(7, np.eye(4)), ValueError, "part: 7 is not in the scene"),
    (lambda s: s.set_transform(1, np.eye(4)), ValueError, "part: part 1 is not in the scene"),
    (lambda s: s.set_transform(0, np.eye(3)), ValueError, r"transform: .* four columns, got \(3, 3\)"),
    (lambda s: s.set_transform(0, np.full((4, 4), 1.0)), ValueError, "transform: .* last row"),
    (lambda s: s.set_transform(0, np.zeros((9, 4))), ValueError, "transform: "),
    (lambda s: s.set_transform(0, np.full((3, 4), np.nan)), ValueError, "transform: not finite"),
    (lambda s: s.set_transform(0, np.eye(4) * 1e60), ValueError, "transform: "),
    (lambda s: s.set_transform(0, "turn"), TypeError, "transform: "),
    (lambda s: s.add_dynamic(meshes.CUBE_VERTICES, meshes.CUBE_FACES, np.eye(4) + np.diag([1e60, 0, 0, 0])), ValueError, "transform: "),
    (lambda s: s.set_vertices(0, [[0, 0, 0]]), ValueError, "vertices: 1 positions for a mesh of 8"),
    (lambda s: s.set_vertices(0, np.full((8, 3), np.inf)), ValueError, "vertices: row 0 is not finite"),
    (lambda s: s.set_mask(0, -1), OverflowError, "out of range"),
    (lambda s: s.remove(1), ValueError, "part"),
    (lambda s: s.add_instance(1, np.eye(4)), ValueError, "part"),
    (lambda s: s.add_static([[0, 0, 0]], [[0, 0, 1]]), ValueError, "faces: row 0"),
    (lambda s: s.add_static(meshes.CUBE_VERTICES, meshes.CUBE_FACES, np.zeros(4)), ValueError, "transform: "),
    (lambda s: s.set_strategy("guess"), ValueError, "strategy: "),
    (lambda s: s.frame.mesh(1), ValueError, "part: 1 is not in the frame"),
    (lambda s: s.frame.mesh(-1), OverflowError, "negative"),
    (lambda s: kd.Scene(preset="x"), ValueError, "preset: "),
    (lambda s: kd.Scene(origin=[np.nan, 0, 0]), ValueError, "origin: "),
]


@pytest.mark.parametrize("row", range(len(REFUSED)))
def test_what_is_refused(row):
    scene = kd.Scene()
    scene.add_dynamic(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    gone = scene.add_dynamic(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    scene.remove(gone)
    scene.commit()
    call, error, words = REFUSED[row]
    with pytest.raises(error, match=words):
        call(scene)
    scene.commit()
    assert scene.parts == [0] == scene.frame.parts
    assert scene.frame.count_hits([[0.5, 0.25, 5]], [[0, 0, -1]]).tolist() == [2]


def test_a_commit_that_fails_keeps_the_frame():
    scene = kd.Scene()
    part = scene.add_dynamic(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
    scene.commit()
    scene.set_transform(part, np.diag([3e38, 3e38, 3e38, 1.0]))
    scene.set_vertices(part, meshes.CUBE_VERTICES * 9)
    with pytest.raises(ValueError, match="part 0"):
        scene.commit()
    assert scene.frame.count_hits([[0.5, 0.25, 5]], [[0, 0, -1]]).tolist() == [2]


def test_repr():
    scene = kd.Scene(strategy="dual")
    assert repr(scene) == '<kd.Scene: 0 parts, strategy "dual">' and repr(scene.frame) == "<kd.Frame: 0 parts>"
