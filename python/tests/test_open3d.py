"""`kd.open3d`, against brute force, and against Open3D itself where it is installed."""

import numpy as np
import pytest

import brute
import kd
import kd._kd
import kd.open3d
import meshes

NONE = kd.open3d.RaycastingScene.INVALID_ID


def scene_of(*all_meshes):
    scene = kd.open3d.RaycastingScene()
    ids = [scene.add_triangles(*mesh) for mesh in all_meshes]
    assert ids == list(range(len(all_meshes)))
    return scene


def three_meshes():
    ball, cube = meshes.octasphere(2), (meshes.CUBE_VERTICES - np.float32(0.3), meshes.CUBE_FACES)
    return [ball, (np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)), cube, (ball[0] * np.float32(0.5), ball[1][:, ::-1])]


def packed(count=2000, seed=6):
    return np.hstack(meshes.rays(count, seed))


def test_shapes_and_types():
    scene = scene_of(*three_meshes())
    for shape in [(), (7,), (2, 3), (0,), (2, 0, 3)]:
        rays = np.zeros((*shape, 6), np.float32)
        found = scene.cast_rays(rays)
        expected = {
            "t_hit": (np.float32, shape), "geometry_ids": (np.uint32, shape), "primitive_ids": (np.uint32, shape),
            "primitive_uvs": (np.float32, (*shape, 2)), "primitive_normals": (np.float32, (*shape, 3)),
        }  # fmt: skip
        assert {name: (a.dtype, a.shape) for name, a in found.items()} == expected
        assert scene.test_occlusions(rays).shape == shape and scene.test_occlusions(rays).dtype == bool
        assert scene.count_intersections(rays).shape == shape and scene.count_intersections(rays).dtype == np.int32
        points = rays[..., :3]
        closest = scene.compute_closest_points(points)
        assert closest["points"].shape == points.shape and closest["points"].dtype == np.float32
        for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
            answer = getattr(scene, name)(points)
            assert (answer.dtype, answer.shape) == (np.float32, shape), name
    listed = scene.list_intersections(packed(50).reshape(5, 10, 6))
    assert listed["ray_splits"].shape == (51,) and listed["primitive_uvs"].shape == (len(listed["t_hit"]), 2)
    assert {name: a.dtype for name, a in listed.items()} == {
        "ray_splits": np.uint32, "ray_ids": np.uint32, "t_hit": np.float32, "geometry_ids": np.uint32,
        "primitive_ids": np.uint32, "primitive_uvs": np.float32,
    }  # fmt: skip


def test_answers_name_the_mesh():
    parts = three_meshes()
    scene, rays = scene_of(*parts), packed()
    found = scene.cast_rays(rays)
    t = np.full((len(parts), len(rays)), np.inf)
    for number, (vertices, faces) in enumerate(parts):
        if len(faces):
            hits = kd.KdTree(vertices, faces).intersect(rays[:, :3], rays[:, 3:])
            t[number] = hits.t
    hit = np.isfinite(t.min(axis=0))
    assert 300 < hit.sum() < 1900
    assert np.array_equal(found["t_hit"], t.min(axis=0).astype(np.float32))
    assert np.array_equal(found["geometry_ids"], np.where(hit, t.argmin(axis=0), NONE))
    assert set(found["geometry_ids"]) == {0, 2, 3, NONE}
    for i in np.flatnonzero(hit)[:200]:
        vertices, faces = parts[found["geometry_ids"][i]]
        a, b, c = vertices[faces[found["primitive_ids"][i]]].astype(np.float64)
        u, v = found["primitive_uvs"][i]
        np.testing.assert_allclose(rays[i, :3] + found["t_hit"][i] * rays[i, 3:], (1 - u - v) * a + u * b + v * c, atol=1e-5)
        normal = np.cross(b - a, c - a)
        np.testing.assert_allclose(found["primitive_normals"][i], normal / np.linalg.norm(normal), atol=1e-6)
    assert (found["primitive_ids"][~hit] == NONE).all() and (found["primitive_normals"][~hit] == 0).all()
    assert (found["primitive_uvs"][~hit] == 0).all()
    assert np.array_equal(scene.test_occlusions(rays), hit)
    assert np.array_equal(scene.test_occlusions(rays, tfar=0.5), t.min(axis=0) <= 0.5)

    listed = scene.list_intersections(rays)
    counts = scene.count_intersections(rays)
    assert np.array_equal(np.diff(listed["ray_splits"].astype(int)), counts)
    assert np.array_equal(listed["ray_ids"], np.repeat(np.arange(len(rays)), counts))
    first = listed["ray_splits"][:-1][hit]
    assert np.array_equal(listed["t_hit"][first], found["t_hit"][hit])
    assert np.array_equal(listed["geometry_ids"][first], found["geometry_ids"][hit])

    points = rays[:500, :3]
    distances = [brute.closest_points(v, f, points).min(axis=1) if len(f) else np.full(500, np.inf) for v, f in parts]
    np.testing.assert_allclose(scene.compute_distance(points), np.min(distances, axis=0), atol=1e-6)
    closest = scene.compute_closest_points(points)
    np.testing.assert_allclose(np.linalg.norm(closest["points"] - points, axis=1), np.min(distances, axis=0), atol=1e-5)
    clear = np.sort(distances, axis=0)[0] < np.sort(distances, axis=0)[1] - 1e-4
    assert np.array_equal(closest["geometry_ids"][clear], np.argmin(distances, axis=0)[clear])


def test_distances_have_the_sign_of_open3d():
    scene = scene_of(meshes.octasphere(3))
    points = np.float32([[[0, 0, 0], [0, 0, 2]]])
    assert scene.compute_signed_distance(points, nsamples=3)[0, 0] < -0.9
    assert scene.compute_signed_distance(points)[0, 1] == 1.0
    assert scene.compute_occupancy(points).tolist() == [[1.0, 0.0]]
    assert scene.compute_distance(points)[0, 0] > 0.9


def test_every_vertex_and_edge_counts_once():
    vertices, faces = meshes.octasphere(5)
    scene = scene_of((vertices, faces))
    middles = (vertices[faces] + vertices[np.roll(faces, 1, axis=1)]).reshape(-1, 3) / 2
    directions = np.vstack([vertices, middles]).astype(np.float32)
    rays = np.hstack([np.zeros_like(directions), directions])
    assert (scene.count_intersections(rays) == 1).all() and scene.test_occlusions(rays).all()
    assert len(scene.list_intersections(rays)["t_hit"]) == len(rays)


def test_meshes_can_be_added_between_questions():
    scene = kd.open3d.RaycastingScene(nthreads=1)
    ray = [[0.25, 0.25, 5, 0, 0, -1]]
    assert not scene.test_occlusions(ray).any() and scene.cast_rays(ray)["geometry_ids"].tolist() == [NONE]
    assert scene.compute_closest_points([[0, 0, 0]])["primitive_ids"].tolist() == [NONE]
    triangle = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    scene.add_triangles(triangle, [[0, 1, 2]])
    assert scene.count_intersections(ray).tolist() == [1]
    scene.add_triangles(triangle + np.float32([0, 0, 1]), np.uint32([[0, 1, 2]]))
    assert scene.count_intersections(ray, nthreads=2).tolist() == [2]
    assert scene.cast_rays(ray)["geometry_ids"].tolist() == [1]

    class Mesh:
        vertices, faces = triangle + np.float32([0, 0, 2]), [[0, 1, 2]]

    assert scene.add_triangles(Mesh()) == 2 and scene.cast_rays(ray)["t_hit"].tolist() == [3.0]


REFUSED = [
    (lambda s: s.cast_rays(np.zeros((2, 5))), ValueError, r"rays: .* \(..., 6\), got \(2, 5\)"),
    (lambda s: s.cast_rays(3.0), ValueError, "rays: "),
    (lambda s: s.cast_rays(np.zeros((2, 6), object)), TypeError, "rays: .* object"),
    (lambda s: s.compute_distance(np.zeros((2, 4))), ValueError, "query_points: "),
    (lambda s: s.compute_occupancy(np.zeros((2, 3)), nsamples=2), ValueError, "nsamples: "),
    (lambda s: s.cast_rays(np.zeros((2, 6)), nthreads=-1), OverflowError, "negative"),
    (lambda s: s.add_triangles([[0, 0, 0]], [[0, 0, 1]]), ValueError, "triangles: row 0"),
    (lambda s: s.add_triangles([[0, 0, 0]], [[0, 0, 0], [0, 0, -1]]), ValueError, "triangles: row 1"),
    (lambda s: s.add_triangles([[0, 0, 0]], [[0, 0, 0.5]]), TypeError, "triangles: expected integers"),
    (lambda s: s.add_triangles([[0, 0, 1e39]], [[0, 0, 0]]), ValueError, "vertices: row 0"),
    (lambda s: s.add_triangles(np.zeros((1, 3), complex), [[0, 0, 0]]), TypeError, "vertices: .* complex"),
    (lambda s: s.add_triangles([[0, 0, 0]]), TypeError, "vertices: "),
    (lambda s: s.create_rays_pinhole(np.eye(4), np.eye(4), 2, 2), ValueError, "intrinsic_matrix: "),
    (lambda s: kd._kd.Geometries(kd.KdTree([[0, 0, 0]], [[0, 0, 0]]), []), ValueError, "starts: "),
    (lambda s: kd._kd.Geometries(kd.KdTree([[0, 0, 0]], [[0, 0, 0]]), [1]), ValueError, "starts: "),
]


@pytest.mark.parametrize("row", range(len(REFUSED)))
def test_what_is_refused(row):
    scene = scene_of(meshes.octasphere(1))
    call, error, words = REFUSED[row]
    with pytest.raises(error, match=words):
        call(scene)
    assert scene.count_intersections([[0, 0, 0, 0.1, 0.2, 0.3]]).tolist() == [1]


def test_pinhole_cameras():
    rays = kd.open3d.RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, -2], [0, 1, 0], 4, 2)
    assert rays.shape == (2, 4, 6) and rays.dtype == np.float32
    np.testing.assert_allclose(rays[..., :3], np.broadcast_to([0, 0, -2], (2, 4, 3)), atol=1e-7)
    np.testing.assert_allclose(rays[0, :, 3:], [[x, -0.25, 1] for x in (-0.75, -0.25, 0.25, 0.75)], atol=1e-7)


def test_open3d_answers_alike():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    tensor = o3d.core.Tensor
    theirs, parts = o3d.t.geometry.RaycastingScene(), [mesh for mesh in three_meshes() if len(mesh[1])]
    ours = scene_of(*parts)
    for vertices, faces in parts:
        theirs.add_triangles(tensor(np.ascontiguousarray(vertices)), tensor(np.ascontiguousarray(faces, np.uint32)))
    rays = packed(4000, seed=1).reshape(40, 100, 6)
    mine, yours = ours.cast_rays(rays), {k: v.numpy() for k, v in theirs.cast_rays(tensor(rays)).items()}
    assert {k: (a.dtype, a.shape) for k, a in mine.items()} == {k: (a.dtype, a.shape) for k, a in yours.items()}
    same = mine["primitive_ids"] == yours["primitive_ids"]
    assert same.mean() > 0.999
    for name in ("t_hit", "primitive_uvs", "primitive_normals", "geometry_ids"):
        np.testing.assert_allclose(mine[name][same], yours[name][same], rtol=1e-4, atol=1e-4, err_msg=name)
    occluded = theirs.test_occlusions(tensor(rays), 0.2, 0.6).numpy()
    assert (ours.test_occlusions(rays, 0.2, 0.6) == occluded).mean() > 0.999
    counts = theirs.count_intersections(tensor(rays)).numpy()
    assert counts.dtype == ours.count_intersections(rays).dtype and (ours.count_intersections(rays) == counts).mean() > 0.999
    mine, yours = ours.list_intersections(rays), {k: v.numpy() for k, v in theirs.list_intersections(tensor(rays)).items()}
    assert {k: (a.dtype, a.ndim) for k, a in mine.items()} == {k: (a.dtype, a.ndim) for k, a in yours.items()}
    assert mine["ray_splits"].shape == yours["ray_splits"].shape
    points = rays[..., :3]
    mine, yours = ours.compute_closest_points(points), {k: v.numpy() for k, v in theirs.compute_closest_points(tensor(points)).items()}
    assert {k: (a.dtype, a.shape) for k, a in mine.items()} == {k: (a.dtype, a.shape) for k, a in yours.items()}
    for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        a, b = getattr(ours, name)(points), getattr(theirs, name)(tensor(points)).numpy()
        assert a.dtype == b.dtype and a.shape == b.shape
        assert (np.abs(a - b) < 1e-5).mean() > 0.995, name
    rng = np.random.default_rng(0)
    for _ in range(5):
        fov, center, eye = rng.uniform(20, 120), rng.normal(size=3), rng.normal(size=3)
        expected = theirs.create_rays_pinhole(fov, center, eye, [0.1, 1, 0.2], 7, 5).numpy()
        np.testing.assert_allclose(ours.create_rays_pinhole(fov, center, eye, [0.1, 1, 0.2], 7, 5), expected, atol=1e-5)
        intrinsic = np.array([[50.0, 2.0, 3.0], [0.0, 40.0, 2.0], [0.0, 0.0, 1.0]])
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        extrinsic = np.eye(4)
        extrinsic[:3, :3], extrinsic[:3, 3] = turn, eye
        expected = theirs.create_rays_pinhole(tensor(intrinsic), tensor(extrinsic), 7, 5).numpy()
        np.testing.assert_allclose(ours.create_rays_pinhole(intrinsic, extrinsic, 7, 5), expected, atol=1e-5)
