"""Ray and distance queries with the interface of Open3D's ``t.geometry.RaycastingScene``, on NumPy arrays.

    scene = kd.open3d.RaycastingScene()
    scene.add_triangles(vertices, triangles)
    ans = scene.cast_rays(rays)

Shapes and types are those of Open3D 0.20, with arrays in the place of tensors. Answers differ where Open3D loses hits or counts them twice: a
ray exactly through an edge or a vertex hits the surface, and counts there as often as the surface is crossed (``KdTree.crossings``). The
lists of ``list_intersections`` are ordered along the rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kd._kd import Geometries, KdTree

__all__ = ["RaycastingScene"]


class RaycastingScene:
    """Triangle meshes that rays and points are asked about. The tree is built at the first question after a mesh was added.

    Parameters
    ----------
    nthreads : int
        The number of threads of builds; 0 for all.
    """

    #: The number of no geometry and of no triangle.
    INVALID_ID = 0xFFFFFFFF

    def __init__(self, nthreads: int = 0) -> None:
        self._nthreads = nthreads
        self._meshes: list[tuple[NDArray[np.float32], NDArray[np.integer[Any]]]] = []
        self._built: tuple[KdTree, Geometries] | None = None

    def add_triangles(self, vertices: Any, triangles: ArrayLike | None = None) -> int:
        """Adds a mesh, and returns its geometry id: 0 for the first, then 1 and so on.

        Parameters
        ----------
        vertices : (N, 3) float
            Rounded to float32. Alone, a mesh: an object with ``vertices`` and ``faces``, as trimesh has them, or an Open3D
            ``t.geometry.TriangleMesh``.
        triangles : (M, 3) int
        """
        if triangles is None:
            vertices, triangles = _arrays_of(vertices)
        # Checked now, so that the error is about this mesh.
        self._meshes.append(_checked(vertices, triangles))
        self._built = None
        return len(self._meshes) - 1

    def _geometries(self) -> tuple[KdTree, Geometries]:
        if self._built is None:
            triangles = [len(faces) for _, faces in self._meshes]
            vertices = [len(positions) for positions, _ in self._meshes]
            shifts = np.cumsum([0, *vertices])
            none = (np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
            positions = np.concatenate([none[0], *(positions for positions, _ in self._meshes)])
            faces = np.concatenate([none[1], *(f + np.uint32(s) for (_, f), s in zip(self._meshes, shifts))])
            tree = KdTree(positions, faces, threads=self._nthreads or None)
            starts = np.cumsum([0, *triangles])[: len(triangles)]
            self._built = tree, Geometries(tree, starts.tolist())
        return self._built

    def cast_rays(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """The closest hit of each ray.

        Parameters
        ----------
        rays : (..., 6) float
            Origin and direction. ``t_hit`` is measured in multiples of the direction.

        Returns
        -------
        dict
            ``t_hit`` (...) float32, infinite for a miss; ``geometry_ids`` and ``primitive_ids`` (...) uint32, ``INVALID_ID`` for a miss;
            ``primitive_uvs`` (..., 2) and ``primitive_normals`` (..., 3) float32, 0 for a miss.
        """
        shape, rows = _flat(rays, 6, "rays")
        t, geometries, triangles, uvs, normals = self._geometries()[1].cast(rows, nthreads)
        return {
            "t_hit": t.reshape(shape),
            "geometry_ids": geometries.reshape(shape),
            "primitive_ids": triangles.reshape(shape),
            "primitive_uvs": uvs.reshape(*shape, 2),
            "primitive_normals": normals.reshape(*shape, 3),
        }

    def test_occlusions(
        self, rays: ArrayLike, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0
    ) -> NDArray[np.bool_]:
        """Whether each ray hits anything from ``tnear`` to ``tfar``: (...) bool."""
        shape, rows = _flat(rays, 6, "rays")
        return self._geometries()[1].occluded(rows, tnear, tfar, nthreads).reshape(shape)

    def count_intersections(self, rays: ArrayLike, nthreads: int = 0) -> NDArray[np.int32]:
        """How often each ray crosses the surface: (...) int32."""
        shape, rows = _flat(rays, 6, "rays")
        return self._geometries()[1].count(rows, nthreads).reshape(shape)

    def list_intersections(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """All crossings of each ray, in order.

        Returns
        -------
        dict
            ``ray_splits`` (N + 1,) uint32: where those of each ray begin, and their number. ``ray_ids``, ``geometry_ids``,
            ``primitive_ids`` (M,) uint32; ``t_hit`` (M,) and ``primitive_uvs`` (M, 2) float32.
        """
        _, rows = _flat(rays, 6, "rays")
        splits, owners, t, geometries, triangles, uvs = self._geometries()[1].list(rows, nthreads)
        return {
            "ray_splits": splits,
            "ray_ids": owners,
            "t_hit": t,
            "geometry_ids": geometries,
            "primitive_ids": triangles,
            "primitive_uvs": uvs,
        }

    def compute_closest_points(self, query_points: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """The point of the surface that is closest to each of the points (..., 3).

        Returns
        -------
        dict
            ``points`` (..., 3) float32; ``geometry_ids`` and ``primitive_ids`` (...) uint32; ``primitive_uvs`` (..., 2) and
            ``primitive_normals`` (..., 3) float32. For a point that is not finite ``INVALID_ID``, NaN and 0.
        """
        shape, rows = _flat(query_points, 3, "query_points")
        points, geometries, triangles, uvs, normals = self._geometries()[1].closest(rows, nthreads)
        return {
            "points": points.reshape(*shape, 3),
            "geometry_ids": geometries.reshape(shape),
            "primitive_ids": triangles.reshape(shape),
            "primitive_uvs": uvs.reshape(*shape, 2),
            "primitive_normals": normals.reshape(*shape, 3),
        }

    def compute_distance(self, query_points: ArrayLike, nthreads: int = 0) -> NDArray[np.float32]:
        """The distance of each point from the surface: (...) float32."""
        shape, rows = _flat(query_points, 3, "query_points")
        return self._tree(nthreads).closest_point(rows).distance.reshape(shape)

    def compute_signed_distance(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """The distance of each point from the surface, negative inside: (...) float32.

        The sign is exact for closed meshes, so that ``nsamples`` has no effect.
        """
        _check_samples(nsamples)
        shape, rows = _flat(query_points, 3, "query_points")
        return self._tree(nthreads).signed_distance(rows).reshape(shape)

    def compute_occupancy(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """1 for points inside of the surface or on it, 0 outside: (...) float32. Exact for closed meshes; ``nsamples`` has no effect."""
        _check_samples(nsamples)
        shape, rows = _flat(query_points, 3, "query_points")
        return self._tree(nthreads).contains(rows).astype(np.float32).reshape(shape)

    def _tree(self, nthreads: int) -> KdTree:
        return self._geometries()[0].with_threads(nthreads or None)

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> NDArray[np.float32]:
        """Rays through the middles of the pixels of a pinhole camera: (height_px, width_px, 6) float32.

        ``create_rays_pinhole(intrinsic_matrix, extrinsic_matrix, width_px, height_px)`` or
        ``create_rays_pinhole(fov_deg, center, eye, up, width_px, height_px)``, where the field of view is horizontal.
        """
        if len(args) + len(kwargs) == 4:
            return _rays_of_matrices(*args, **kwargs)
        return _rays_of_view(*args, **kwargs)


def _rays_of_matrices(
    intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int
) -> NDArray[np.float32]:
    intrinsic = np.asarray(intrinsic_matrix, np.float64)
    extrinsic = np.asarray(extrinsic_matrix, np.float64)
    if intrinsic.shape != (3, 3) or extrinsic.shape != (4, 4):
        raise ValueError("intrinsic_matrix: expected shape (3, 3), and (4, 4) of extrinsic_matrix")
    rotation, shift = extrinsic[:3, :3], extrinsic[:3, 3]
    # A pixel's ray in the world, from the homogeneous place of its middle.
    of_pixel = rotation.T @ np.linalg.inv(intrinsic)
    pixels = np.ones((height_px, width_px, 3))
    pixels[..., 0] = np.arange(width_px) + 0.5
    pixels[..., 1] = np.arange(height_px)[:, None] + 0.5
    rays = np.empty((height_px, width_px, 6), np.float32)
    rays[..., :3] = -rotation.T @ shift
    rays[..., 3:] = pixels @ of_pixel.T
    return rays


def _rays_of_view(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
) -> NDArray[np.float32]:
    focal = 0.5 * width_px / np.tan(0.5 * np.deg2rad(fov_deg))
    intrinsic = np.array([[focal, 0, 0.5 * width_px], [0, focal, 0.5 * height_px], [0, 0, 1]])
    eye = np.asarray(eye, np.float64)
    forward = np.asarray(center, np.float64) - eye
    right = np.cross(np.asarray(up, np.float64), forward)
    axes = np.array([right, np.cross(forward, right), forward])
    rotation = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = rotation
    extrinsic[:3, 3] = -rotation @ eye
    return _rays_of_matrices(intrinsic, extrinsic, width_px, height_px)


def _checked(vertices: ArrayLike, triangles: ArrayLike) -> tuple[NDArray[np.float32], NDArray[Any]]:
    given = np.asarray(vertices)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"vertices: expected floats, got an array of dtype {given.dtype}")
    with np.errstate(over="ignore"):
        positions = given.astype(np.float32).reshape(-1, 3)
    faces = np.array(triangles).reshape(-1, 3)
    if not np.issubdtype(faces.dtype, np.integer) and faces.size:
        raise TypeError(f"triangles: expected integers, got an array of dtype {faces.dtype}")
    wrong = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(wrong):
        raise ValueError(f"vertices: row {wrong[0]} is not finite in float32")
    wrong = np.flatnonzero(((faces < 0) | (faces >= len(positions))).any(axis=1))
    if len(wrong):
        raise ValueError(f"triangles: row {wrong[0]} has an index out of range for {len(positions)} vertices")
    return positions, faces.astype(np.uint32)


def _arrays_of(mesh: Any) -> tuple[Any, Any]:
    if hasattr(mesh, "faces"):
        return mesh.vertices, mesh.faces
    if hasattr(mesh, "triangle"):
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    raise TypeError("vertices: expected vertices and triangles, or a mesh")


def _flat(values: ArrayLike, columns: int, argument: str) -> tuple[tuple[int, ...], NDArray[Any]]:
    array = np.asarray(values)
    if array.ndim == 0 or array.shape[-1] != columns:
        raise ValueError(f"{argument}: expected an array of shape (..., {columns}), got {array.shape}")
    if columns == 6 and array.dtype == np.float64:
        # Numbers beyond float32 become infinite, and their rays misses.
        with np.errstate(over="ignore"):
            array = array.astype(np.float32)
    return array.shape[:-1], array.reshape(-1, columns)


def _check_samples(nsamples: int) -> None:
    if nsamples < 1 or nsamples % 2 != 1:
        raise ValueError(f"nsamples: expected an odd number of at least 1, got {nsamples}")
