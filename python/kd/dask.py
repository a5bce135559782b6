"""Queries of Dask arrays of rays and points, on any scheduler and any number of machines.

Every worker opens the same file by its path, once, and answers its blocks. So the file lies where all workers find it: on a shared file
system, or copied to the same place on each machine.

>>> import dask.array as da, kd.dask, numpy
>>> kd.KdTree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).save("tile.kd")
>>> tree = kd.dask.Tree("tile.kd")
>>> origins = da.full((1000, 3), 0.25, chunks=(100, 3))
>>> directions = da.from_array(numpy.tile([0.0, 0.0, -1.0], (1000, 1)), chunks=(100, 3))
>>> int((tree.intersect(origins, directions).triangle == 0).sum().compute())
1000

Answers are those of :class:`kd.KdTree` for the same rays, whatever the blocks, the scheduler and the workers: a block that is computed
again, because its worker was lost, has the same answer to the bit.

A worker whose file is another one than where the arrays were made, or whose version of kd is, raises an error that says so.
"""

from __future__ import annotations

import os
import threading
from functools import partial
from typing import Any, NamedTuple

import dask.array as da
import numpy as np

import kd

__all__ = ["ClosestPoints", "Hits", "Tree"]

_HIT = np.dtype([("t", "f4"), ("triangle", "i4"), ("u", "f4"), ("v", "f4")])
_NEAREST = np.dtype(
    [("point", "f8", 3), ("distance", "f4"), ("triangle", "i4"), ("u", "f4"), ("v", "f4"), ("feature", "i1")]
)


class Hits(NamedTuple):
    """The closest hit of each ray, as the attributes of :class:`kd.Hits`: Dask arrays of shape (N,)."""

    t: da.Array
    triangle: da.Array
    u: da.Array
    v: da.Array
    hit: da.Array


class ClosestPoints(NamedTuple):
    """The closest point of the surface to each point, as the attributes of :class:`kd.ClosestPoints`: Dask arrays of N rows."""

    point: da.Array
    distance: da.Array
    triangle: da.Array
    u: da.Array
    v: da.Array
    feature: da.Array


class Tree:
    """A tree in a file of :meth:`kd.KdTree.save`, for Dask arrays.

    Parameters
    ----------
    path : str or path
        The file, at this path on every worker. As with ``numpy.memmap``, nothing may change it while it is in use; saving another tree under
        the same name replaces it and is allowed.
    verify : bool
        Whether each worker reads and checks all of the file when it opens it (:meth:`kd.KdTree.open`).
    threads : int, optional
        Threads of one block. One, since a scheduler runs several blocks at a time; None for all.
    """

    def __init__(self, path: str | os.PathLike[str], verify: bool = True, threads: int | None = 1) -> None:
        self.path = os.path.abspath(path)
        self.verify = bool(verify)
        self.threads = threads
        self._fingerprint = _fingerprint(self.path)

    def __repr__(self) -> str:
        return f"<kd.dask.Tree: {self.path}>"

    def intersect(
        self,
        origins: Any,
        directions: Any,
        t_min: Any = None,
        t_max: Any = None,
        culling: str | None = None,
        mask: Any = None,
    ) -> Hits:
        """The closest hit of each ray, as :meth:`kd.KdTree.intersect`.

        ``origins`` and ``directions`` are arrays of shape (N, 3), ``t_min``, ``t_max`` and ``mask`` are numbers or arrays of shape (N,).
        Results have the chunks of ``origins``, aligned with those of the others.
        """
        hits = self._rays("intersect", _HIT, origins, directions, t_min, t_max, culling, mask)
        fields = [hits[name] for name in ("t", "triangle", "u", "v")]
        return Hits(*fields, hit=fields[1] >= 0)

    def occluded(
        self,
        origins: Any,
        directions: Any,
        t_min: Any = None,
        t_max: Any = None,
        culling: str | None = None,
        mask: Any = None,
    ) -> da.Array:
        """Whether each ray hits anything, as :meth:`kd.KdTree.occluded`: a bool array of shape (N,)."""
        return self._rays("occluded", np.dtype(bool), origins, directions, t_min, t_max, culling, mask)

    def count_hits(
        self,
        origins: Any,
        directions: Any,
        t_min: Any = None,
        t_max: Any = None,
        culling: str | None = None,
        mask: Any = None,
    ) -> da.Array:
        """The number of hits of each ray, as :meth:`kd.KdTree.count_hits`: an int64 array of shape (N,)."""
        return self._rays("count_hits", np.dtype("i8"), origins, directions, t_min, t_max, culling, mask)

    def closest_point(self, points: Any, max_distance: float = np.inf) -> ClosestPoints:
        """The closest point of the surface to each point, as :meth:`kd.KdTree.closest_point`."""
        nearest = self._blocks("closest_point", _NEAREST, {"points": points}, {"max_distance": max_distance})
        rows = nearest.map_blocks(_field, "point", new_axis=1, chunks=(nearest.chunks[0], (3,)), dtype="f8", meta=np.empty((0, 3)))
        rest = [nearest[name] for name in ("distance", "triangle", "u", "v", "feature")]
        return ClosestPoints(rows, *rest)

    def contains(self, points: Any) -> da.Array:
        """Whether each point is inside of the closed surface, as :meth:`kd.KdTree.contains`: a bool array of shape (N,)."""
        return self._blocks("contains", np.dtype(bool), {"points": points}, {})

    def signed_distance(self, points: Any) -> da.Array:
        """The distance of each point from the closed surface, as :meth:`kd.KdTree.signed_distance`: a float32 array of shape (N,)."""
        return self._blocks("signed_distance", np.dtype("f4"), {"points": points}, {})

    def winding_number(self, points: Any) -> da.Array:
        """How often the surface winds around each point, as :meth:`kd.KdTree.winding_number`: a float64 array of shape (N,)."""
        return self._blocks("winding_number", np.dtype("f8"), {"points": points}, {})

    def _rays(self, query, dtype, origins, directions, t_min, t_max, culling, mask) -> da.Array:
        arrays = {"origins": origins, "directions": directions}
        numbers = {"culling": culling}
        for name, value in (("t_min", t_min), ("t_max", t_max), ("mask", mask)):
            is_array = isinstance(value, da.Array) or np.ndim(value) > 0
            (arrays if is_array else numbers)[name] = value
        return self._blocks(query, dtype, arrays, numbers)

    def _blocks(self, query: str, dtype: np.dtype, arrays: dict[str, Any], numbers: dict[str, Any]) -> da.Array:
        """Answers to rows, block by block."""
        operands: list[Any] = []
        for name, array in arrays.items():
            array = array if isinstance(array, da.Array) else da.asarray(array)
            has_rows = name in ("origins", "directions", "points")
            if has_rows and (array.ndim != 2 or array.shape[1] != 3):
                raise ValueError(f"{name}: expected an array of shape (N, 3), got shape {array.shape}")
            if not has_rows and array.ndim != 1:
                raise ValueError(f"{name}: expected a number or an array of shape (N,), got shape {array.shape}")
            lengths = {len(operand) for operand in operands[::2] if not np.isnan(operand.shape[0])}
            if lengths and not np.isnan(array.shape[0]) and len(array) not in lengths:
                raise ValueError(f"{name}: {len(array)} rows, expected {lengths.pop()}")
            operands += [array.rechunk({1: -1}), "ij"] if has_rows else [array, "i"]
        answer = partial(
            _answer,
            names=tuple(arrays),
            query=query,
            dtype=dtype,
            numbers={name: value for name, value in numbers.items() if value is not None},
            file=(self.path, self.verify, self._fingerprint, kd.__version__),
            threads=self.threads,
        )
        return da.blockwise(
            answer, "i", *operands, dtype=dtype, meta=np.empty(0, dtype), concatenate=True, name=None, token=f"kd-{query}"
        )


def _answer(*blocks, names, query, dtype, numbers, file, threads) -> np.ndarray:
    """The answers to a block of rows, on the worker that has it."""
    tree = _opened(*file).with_threads(threads)
    found = getattr(tree, query)(**dict(zip(names, blocks)), **numbers)
    if dtype.names is None:
        return np.asarray(found, dtype)
    packed = np.empty(len(found), dtype)
    for name in dtype.names:
        packed[name] = getattr(found, name)
    return packed


def _field(block: np.ndarray, name: str) -> np.ndarray:
    return block[name]


_trees: dict[tuple[str, bool, bytes], kd.KdTree] = {}
_opening = threading.Lock()


def _opened(path: str, verify: bool, fingerprint: bytes, version: str) -> kd.KdTree:
    """The tree of a file, opened by this process once."""
    if version != kd.__version__:
        raise RuntimeError(f"kd {kd.__version__} on this worker, kd {version} where the arrays were made")
    with _opening:
        tree = _trees.get((path, verify, fingerprint))
        if tree is None:
            if _fingerprint(path) != fingerprint:
                raise ValueError(f"{path}: another file on this worker than where the arrays were made")
            tree = kd.KdTree.open(path, verify=verify)
            _trees[path, verify, fingerprint] = tree
        return tree


def _fingerprint(path: str) -> bytes:
    """What tells a file from others: its header, which has a checksum over those of all sections."""
    with open(path, "rb") as file:
        return file.read(64)
