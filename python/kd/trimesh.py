"""Ray queries for trimesh: exact, without missed or doubled hits, on all threads.

One mesh::

    mesh.ray = kd.trimesh.RayMeshIntersector(mesh)

All meshes that are made from now on, also inside of trimesh, for example for ``mesh.contains``::

    kd.trimesh.install()

Two queries return what embreex does not promise:

- A ray that passes exactly through an edge or a vertex has one hit there where the surface is crossed once, not one for each triangle around
  it. ``KdTree.crossings`` defines it. Coincident triangles count one by one.
- Hits are ordered by ray, then along the ray.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import trimesh
import trimesh.ray
from numpy.typing import ArrayLike, NDArray
from trimesh import caching
from trimesh.ray import ray_util

from kd._kd import Intersector, KdTree

__all__ = ["RayMeshIntersector", "install"]


class RayMeshIntersector:
    """A drop-in for ``trimesh.ray.ray_pyembree.RayMeshIntersector``.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        The mesh. It may change later: the tree is built at the first query, and again when the hash of the mesh changes.
    scale_to_box : bool
        Accepted, and without effect: answers are exact at any scale.
    """

    def __init__(self, geometry: trimesh.Trimesh, scale_to_box: bool = True) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._cache = caching.Cache(id_function=self.mesh.__hash__)

    @caching.cache_decorator
    def _tree(self) -> KdTree:
        return KdTree(np.asarray(self.mesh.vertices, np.float64), np.asarray(self.mesh.faces))

    @caching.cache_decorator
    def _intersector(self) -> Intersector:
        return Intersector(self._tree, np.asarray(self.mesh.vertices, np.float64))

    @caching.cache_decorator
    def _is_closed(self) -> bool:
        return self._tree.is_closed

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Where rays hit the surface.

        Returns
        -------
        locations : (m, 3) float64
        index_ray : (m,) int64
        index_tri : (m,) int64
        """
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> tuple[NDArray[Any], ...]:
        """The faces that rays hit: the first one of each ray, or all crossings, at most ``max_hits`` of a ray.

        Returns
        -------
        index_tri : (m,) int64
        index_ray : (m,) int64
        locations : (m, 3) float64
            Only if ``return_locations``. They are on the ray and in the plane of the face, in float64.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        index_tri, index_ray, locations = self._intersector.all(
            origins, directions, bool(multiple_hits), max(int(max_hits), 0), bool(return_locations)
        )
        if return_locations:
            return index_tri, index_ray, locations
        return index_tri, index_ray

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int32]:
        """The face that each ray hits first, -1 for a miss: (n,) int32. The lower one where several are hit at the same distance."""
        return self._intersector.first(*_rays(ray_origins, ray_directions))

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits the surface: (n,) bool."""
        return self._intersector.any(*_rays(ray_origins, ray_directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points are inside of the mesh: (n,) bool.

        Exact where the mesh is closed; points on the surface are inside. On open meshes the answer is trimesh's own, by the parity of the
        hits of rays in two directions.
        """
        points = np.asanyarray(points, dtype=np.float64)
        if not trimesh.util.is_shape(points, (-1, 3)):
            raise ValueError("points must be (n,3)")
        if self.mesh.is_watertight or self._is_closed:
            return self._tree.contains(points)
        return ray_util.contains_points(self, points)

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        # The tree is built again from the mesh.
        state.pop("_cache", None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._cache = caching.Cache(id_function=self.mesh.__hash__)

    def __copy__(self, *_: Any) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box)

    def __deepcopy__(self, *_: Any) -> RayMeshIntersector:
        return self.__copy__()


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    origins = np.asanyarray(origins)
    directions = np.asanyarray(directions)
    if origins.shape != directions.shape:
        raise ValueError("Ray origin and direction don't match!")
    return origins, directions


def install() -> None:
    """Makes trimesh use this module for all meshes that are made from now on.

    It takes the place of ``trimesh.ray.ray_pyembree``, whether embreex is there or not, and sets ``trimesh.ray.has_embree``, so that
    ``Trimesh(..., use_embree=True)``, the default, makes a :class:`RayMeshIntersector` of this module. Meshes that exist keep theirs.
    Lasts until the process ends.
    """
    module = sys.modules[__name__]
    sys.modules["trimesh.ray.ray_pyembree"] = module
    trimesh.ray.ray_pyembree = module
    trimesh.ray.has_embree = True
