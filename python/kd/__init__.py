"""kd-trees over triangle meshes: exact, watertight ray and point queries for whole NumPy arrays, on all threads.

>>> import kd
>>> tree = kd.KdTree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
>>> hits = tree.intersect([[0.25, 0.25, 5.0]], [[0.0, 0.0, -1.0]])
>>> float(hits.t[0]), int(hits.triangle[0])
(5.0, 0)

:mod:`kd.trimesh` and :mod:`kd.open3d` have the interfaces of trimesh's ray queries and of Open3D's ``RaycastingScene``.
:mod:`kd.dask` takes Dask arrays.
"""

from kd._kd import ClosestPoints, Frame, HitLists, Hits, KdTree, Scene, TriangleLists, __version__

__all__ = ["ClosestPoints", "Frame", "HitLists", "Hits", "KdTree", "Scene", "TriangleLists"]
