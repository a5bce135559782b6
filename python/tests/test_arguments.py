"""Arguments: what is accepted, and what is refused in words that name the argument and the row."""

import numpy as np
import pytest

import kd
import meshes

TREE = kd.KdTree(meshes.CUBE_VERTICES, meshes.CUBE_FACES)
ONE = [[0.5, 0.25, 5.0]]
DOWN = [[0.0, 0.0, -1.0]]


def objects():
    return np.array([[None, 1, 2]], dtype=object)


REFUSED = [
    (lambda: TREE.intersect([[0, 0]], DOWN), ValueError, r"origins: expected .* \(N, 3\), got \(1, 2\)"),
    (lambda: TREE.intersect(ONE, np.zeros((2, 3, 1))), ValueError, r"directions: expected .* got \(2, 3, 1\)"),
    (lambda: TREE.intersect(np.zeros((2, 3)), np.zeros((3, 3))), ValueError, "directions: 3 rows for 2 origins"),
    (lambda: TREE.intersect(5.0, DOWN), ValueError, r"origins: expected .* got \(\)"),
    (lambda: TREE.intersect(objects(), DOWN), TypeError, "origins: .* object"),
    (lambda: TREE.intersect(ONE, objects()), TypeError, "directions: .* object"),
    (lambda: TREE.intersect(np.zeros((1, 3), complex), DOWN), TypeError, "origins: .* complex"),
    (lambda: TREE.intersect(np.zeros((1, 3), bool), DOWN), TypeError, "origins: .* bool"),
    (lambda: TREE.intersect([["a", "b", "c"]], DOWN), TypeError, "origins: "),
    (lambda: TREE.intersect([[1, 2, 3], [1, 2]], DOWN), TypeError, "origins: "),
    (lambda: TREE.intersect(None, DOWN), ValueError, "origins: "),
    (lambda: TREE.intersect(ONE, DOWN, t_min=[1, 2]), ValueError, r"t_min: .* \(1,\), got \(2,\)"),
    (lambda: TREE.intersect(ONE, DOWN, t_max="far"), TypeError, "t_max: "),
    (lambda: TREE.intersect(ONE, DOWN, mask=-1), ValueError, "mask: row 0 is -1"),
    (lambda: TREE.intersect(ONE * 3, DOWN, mask=[1, 2, 2**32]), ValueError, "mask: row 2 is 4294967296"),
    (lambda: TREE.intersect(ONE, DOWN, mask=1.5), TypeError, "mask: expected integers"),
    (lambda: TREE.intersect(ONE, DOWN, culling="sides"), ValueError, 'culling: .* got "sides"'),
    (lambda: TREE.hits(ONE, DOWN, -1), OverflowError, "negative"),
    (lambda: TREE.hits(ONE, DOWN, 1.5), TypeError, "max"),
    (lambda: TREE.intersect(np.broadcast_to(np.zeros(3), (2**33, 3)), DOWN), ValueError, "origins: 8589934592 rows"),
    (lambda: TREE.closest_point([[1, 2]]), ValueError, "points: "),
    (lambda: TREE.closest_point(objects()), TypeError, "points: .* object"),
    (lambda: TREE.contains(np.zeros(4)), ValueError, "points: "),
    (lambda: TREE.triangles_in_box(ONE * 2, ONE), ValueError, "upper: 1 rows for 2"),
    (lambda: TREE.triangles_in_sphere(ONE, [1, 2]), ValueError, "radii: "),
    (lambda: kd.KdTree([[0, 0, 0], [0, np.nan, 0]], []), ValueError, "vertices: row 1 is not finite"),
    (lambda: kd.KdTree(np.float32([[np.inf, 0, 0]]), []), ValueError, "vertices: row 0 is not finite"),
    (lambda: kd.KdTree([[0, 0, 0], [1e300, 0, 0]], []), ValueError, "vertices: row . is out of the range"),
    (lambda: kd.KdTree([[0, 0, 0]], [[0, 0, 0], [0, -1, 0]]), ValueError, "faces: row 1 has index -1"),
    (lambda: kd.KdTree([[0, 0, 0]], [[0, 0, 0], [0, 0, 1]]), ValueError, "faces: row 1 has index 1, .* 1 vertices"),
    (lambda: kd.KdTree([[0, 0, 0]], [[0, 0, 2**40]]), ValueError, "faces: row 0 has an index above"),
    (lambda: kd.KdTree([[0, 0, 0]], np.array([[0, 0, 2**64 - 1]], np.uint64)), ValueError, "faces: row 0 has"),
    (lambda: kd.KdTree([[0, 0, 0]], np.int8([[-5, 0, 0]])), ValueError, "faces: row 0 has index -5"),
    (lambda: kd.KdTree([[0, 0, 0]], [[0.0, 0.0, 0.0]]), TypeError, "faces: expected integers, .* float64"),
    (lambda: kd.KdTree([[0, 0, 0]], objects()), TypeError, "faces: .* object"),
    (lambda: kd.KdTree([[0, 0, 0]], [[0, 0]]), ValueError, r"faces: expected .* \(M, 3\), got \(1, 2\)"),
    (lambda: kd.KdTree(np.zeros((3, 3)), np.broadcast_to(np.int64(0), (2**33, 3))), ValueError, "faces: 8589934592 triangles"),
    (lambda: kd.KdTree(np.broadcast_to(np.float32(0), (2**33, 3)), []), ValueError, "vertices: 8589934592 rows"),
    (lambda: kd.KdTree([[0, 0, 0]], [], preset="quick"), ValueError, 'preset: .* got "quick"'),
    (lambda: kd.KdTree([[0, 0, 0]], [], layout=""), ValueError, "layout: "),
    (lambda: kd.KdTree([[0, 0, 0]], [], threads=0), ValueError, "threads: expected at least 1"),
    (lambda: kd.KdTree([[0, 0, 0]], [], threads=2**40), ValueError, "threads: expected at most"),
    (lambda: kd.KdTree([[0, 0, 0]], [], threads=-1), OverflowError, "negative"),
    (lambda: TREE.hits(ONE, DOWN)[1], IndexError, "ray 1 is out of range for 1 rays"),
    (lambda: TREE.hits(ONE, DOWN)[-2], IndexError, "ray -2"),
    (lambda: kd.KdTree.load("/no/such/file"), FileNotFoundError, "/no/such/file"),
]  # fmt: skip


@pytest.mark.parametrize("row", range(len(REFUSED)))
def test_what_is_refused(row):
    call, error, words = REFUSED[row]
    with pytest.raises(error, match=words):
        call()


def test_nothing_in_gives_nothing_out():
    for nothing in ([], np.zeros((0, 3)), np.zeros((0, 3), np.float32)[::-1], np.zeros((5, 3))[:0, ::-1]):
        hits = TREE.intersect(nothing, nothing)
        assert len(hits) == 0 and hits.t.dtype == np.float32 and hits.triangle.dtype == np.int32
        assert TREE.occluded(nothing, nothing).dtype == bool
        assert TREE.count_hits(nothing, nothing).dtype == np.int64
        lists = TREE.hits(nothing, nothing)
        assert lists.offsets.tolist() == [0] and len(lists) == 0 and len(lists.ray) == 0
        assert TREE.crossings(nothing, nothing).offsets.tolist() == [0]
        assert TREE.closest_point(nothing).point.shape == (0, 3)
        assert TREE.contains(nothing).shape == TREE.signed_distance(nothing).shape == (0,)
        assert TREE.winding_number(nothing).dtype == np.float64
        assert TREE.triangles_in_sphere(nothing, 1.0).offsets.tolist() == [0]
        assert TREE.triangles_in_box(nothing, nothing).offsets.tolist() == [0]


def test_meshes_without_triangles_are_fine():
    for vertices, faces in [([], []), (np.zeros((0, 3)), np.zeros((0, 3), np.int32)), ([[1, 2, 3]], [])]:
        tree = kd.KdTree(vertices, faces)
        assert len(tree) == 0
        assert not tree.occluded(ONE, DOWN).any() and tree.closest_point(ONE).triangle[0] == -1
        assert not tree.contains(ONE).any() and np.isnan(tree.signed_distance(ONE)).all()
        assert tree.winding_number(ONE).tolist() == [0.0]


def packed(array):
    """The same numbers at odd addresses, 13 bytes apart and more."""
    record = np.zeros(len(array), dtype=np.dtype([("x", "i1"), ("a", array.dtype, (3,))]))
    record["a"] = array
    return record["a"]


FORMS = {
    "as it is": lambda a: a,
    "list": lambda a: a.tolist(),
    "Fortran order": np.asfortranarray,
    "every second row": lambda a: np.repeat(a, 2, axis=0)[::2],
    "reversed": lambda a: a[::-1].copy()[::-1],
    "columns of a wider array": lambda a: np.hstack([a, a, a])[:, 3:6],
    "columns turned": lambda a: np.ascontiguousarray(a[:, ::-1])[:, ::-1],
    "byte-swapped": lambda a: a.astype(a.dtype.newbyteorder()),
    "read-only": lambda a: (lambda copy: (copy.setflags(write=False), copy)[1])(a.copy()),
    "at odd addresses": packed,
    "subclass": lambda a: a.view(type("Tracked", (np.ndarray,), {})),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.float16, np.int16, np.int64, np.longdouble])
def test_every_form_of_an_array_is_read_alike(form, dtype):
    origins = np.array([[0, 0, 4], [1, 0, 4], [2, 3, -4], [5, 1, 3]], dtype)
    directions = np.array([[1, 2, -7], [0, 1, -8], [-1, -2, 6], [-4, 0, -3]], dtype)
    vertices, faces = meshes.octasphere(2)
    tree = kd.KdTree(2 * vertices, faces)
    expected = tree.intersect(origins.astype(np.float32), directions.astype(np.float32))
    assert expected.hit.sum() >= 3
    change = FORMS[form]
    before = origins.copy()
    found = tree.intersect(change(origins), change(directions))
    assert np.array_equal(found.t, expected.t) and np.array_equal(found.triangle, expected.triangle)
    assert np.array_equal(origins, before), "arguments are not written to"


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
def test_every_form_of_faces_is_read_alike(form, dtype):
    tree = kd.KdTree(meshes.CUBE_VERTICES, FORMS[form](meshes.CUBE_FACES.astype(dtype)))
    assert np.array_equal(tree.faces, meshes.CUBE_FACES)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_form_of_vertices_is_read_alike(form, dtype):
    tree = kd.KdTree(FORMS[form](meshes.CUBE_VERTICES.astype(dtype)), meshes.CUBE_FACES)
    assert np.array_equal(tree.vertices, meshes.CUBE_VERTICES)


def test_one_row_serves_all_rays():
    directions = np.float32([[0, 0, -1], [0, 0.01, -1], [0, 0, 1]])
    one = TREE.intersect(ONE, directions)
    all_of_them = TREE.intersect(ONE * 3, directions)
    assert np.array_equal(one.t, all_of_them.t) and one.hit.tolist() == [True, True, False]
    assert np.array_equal(TREE.intersect(ONE[0], directions).t, one.t)
    assert len(TREE.intersect(ONE[0], DOWN[0])) == 1
    assert np.array_equal(TREE.intersect(ONE * 3, DOWN[0]).t, np.repeat(one.t[:1], 3))


def test_repr_says_what_it_is():
    assert repr(TREE) == '<kd.KdTree: 12 triangles, 8 vertices, preset "balanced", layout "wide">'
    assert repr(TREE.intersect(ONE, DOWN)) == "<kd.Hits: 1 of 1 rays hit>"
    assert repr(TREE.hits(ONE, DOWN)) == "<kd.HitLists: 2 hits of 1 rays>"
    assert repr(TREE.closest_point(ONE)) == "<kd.ClosestPoints: 1 points>"
    assert repr(TREE.triangles_in_sphere(ONE, 100)) == "<kd.TriangleLists: 12 triangles of 1 regions>"


def test_results_are_not_views_of_the_tree():
    vertices, faces = meshes.CUBE_VERTICES.copy(), meshes.CUBE_FACES.copy()
    tree = kd.KdTree(vertices, faces)
    vertices[:] = 0
    faces[:] = 0
    tree.vertices[:] = 7
    tree.faces[:] = 7
    assert tree.intersect(ONE, DOWN).t[0] == 4.0
