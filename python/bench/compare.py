"""Counts wrong answers and measures speed of kd, embreex and Open3D, through trimesh's interface and through Open3D's.

    python bench/compare.py [--mesh MESH ...] [--rays N] [--repeats K] [--out FILE]

Needs kd, trimesh, embreex and open3d in one environment, and says which of them it lacks. Prints tables in markdown. `--out` gets a line of
JSON for each figure. Speeds are medians; each repeat measures all engines one after the other, so that they see the same machine.
"""

import argparse
import json
import os
import platform
import statistics
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import trimesh

import kd
import kd.open3d
import kd.trimesh

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
import brute  # noqa: E402


class ThroughTrimesh:
    def __init__(self, make, mesh):
        self.mesh = mesh
        self.ray = make(mesh)

    def first(self, origins, directions):
        return self.ray.intersects_first(origins, directions)

    def any(self, origins, directions):
        return self.ray.intersects_any(origins, directions)

    def all(self, origins, directions):
        return self.ray.intersects_location(origins, directions, multiple_hits=True)

    def inside(self, points):
        return self.ray.contains_points(points)

    def counts(self, origins, directions):
        return np.bincount(self.all(origins, directions)[1], minlength=len(origins))

    def hit(self, origins, directions):
        return self.first(origins, directions) >= 0


class ThroughOpen3D:
    def __init__(self, make, mesh):
        self.scene, self.tensor, self.array = make()
        self.scene.add_triangles(
            self.tensor(np.ascontiguousarray(mesh.vertices, np.float32)),
            self.tensor(np.ascontiguousarray(mesh.faces, np.uint32)),
        )

    @staticmethod
    def rays(origins, directions):
        return np.hstack([origins, directions]).astype(np.float32)

    def first(self, rays):
        return self.scene.cast_rays(self.tensor(rays))["t_hit"]

    def any(self, rays):
        return self.scene.test_occlusions(self.tensor(rays))

    def all(self, rays):
        return self.scene.list_intersections(self.tensor(rays))["t_hit"]

    def inside(self, points):
        return self.scene.compute_occupancy(self.tensor(points))

    def closest(self, points):
        return self.scene.compute_closest_points(self.tensor(points))["points"]

    def counts(self, origins, directions):
        return self.array(self.scene.count_intersections(self.tensor(self.rays(origins, directions))))

    def hit(self, origins, directions):
        return self.array(self.any(self.rays(origins, directions)))


def engines():
    """Names, interfaces and how to make one for a mesh; and what is missing."""
    found, missing = {}, []
    found["kd, trimesh"] = lambda mesh: ThroughTrimesh(kd.trimesh.RayMeshIntersector, mesh)
    try:
        # trimesh keeps the error of a missing embreex until the name is used.
        embree = trimesh.ray.ray_pyembree.RayMeshIntersector
        found["embreex, trimesh"] = lambda mesh: ThroughTrimesh(embree, mesh)
    except BaseException as error:
        missing.append(f"embreex: {error}")
    ours = lambda: (kd.open3d.RaycastingScene(), np.asarray, np.asarray)  # noqa: E731
    found["kd, Open3D"] = lambda mesh: ThroughOpen3D(ours, mesh)
    try:
        import open3d

        tensor = open3d.core.Tensor
        theirs = lambda: (open3d.t.geometry.RaycastingScene(), tensor, lambda t: t.numpy())  # noqa: E731
        found["Open3D"] = lambda mesh: ThroughOpen3D(theirs, mesh)
    except BaseException as error:
        missing.append(f"open3d: {error}")
    return found, missing


def plain(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False)


def judged(mesh, origins, directions):
    """The number of hits of each ray by brute force, and which rays pass no edge too closely to tell."""
    counts, sure = [], []
    for start in range(0, len(origins), 256):
        some = slice(start, start + 256)
        t, _, _, margin = brute.all_hits(mesh.vertices, mesh.faces, origins[some], directions[some])
        hits = (margin > 0) & (t >= 0)
        unsure = (np.abs(margin) < 1e-4) & (t > -1e-4)
        counts.append(hits.sum(axis=1))
        sure.append(~unsure.any(axis=1))
    return np.concatenate(counts), np.concatenate(sure)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cases(rng, count):
    """Names, meshes, rays, and the right number of hits of each ray."""
    sphere = trimesh.creation.icosphere(subdivisions=5)
    targets = np.vstack([sphere.vertices, sphere.vertices[sphere.edges_unique].mean(axis=1)])
    for name, eye in (("the middle", [0.0, 0.0, 0.0]), ("beside the middle", [0.1, 0.05, 0.02])):
        origins = np.tile(eye, (len(targets), 1))
        yield f"sphere from {name}, at vertices and edge middles", sphere, origins, targets - eye, np.ones(len(targets), int)

    def rays(mesh):
        ends = rng.uniform(-1, 1, (2, count, 3)) * np.abs(mesh.bounds).max() * 1.5
        return ends[0], ends[1] - ends[0]

    box = trimesh.creation.icosphere(subdivisions=2)
    twice = plain(box.vertices, np.vstack([box.faces, box.faces]))
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float) - 0.5
    shifted = plain(
        np.vstack([square + [0.21 * k, 0.17 * k, 0.0] for k in range(5)]),
        np.vstack([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(5)]),
    )
    thin = trimesh.util.concatenate(
        [trimesh.creation.box([1, 1, 1]).apply_scale([1, 1, 1e-7 * (k + 1)]) for k in range(4)]
    )
    for name, mesh in (("coincident faces", twice), ("coplanar faces", shifted), ("faces 10^-7 apart", thin)):
        origins, directions = rays(mesh)
        counts, sure = judged(mesh, origins, directions)
        yield name, mesh, origins[sure], directions[sure], counts[sure]

    ball = trimesh.creation.icosphere(subdivisions=4)
    inside = 0.9 * unit(rng.normal(size=(count, 3))) * rng.uniform(0, 1, (count, 1))
    for distance in (1e2, 1e4, 1e6):
        direction = unit(rng.normal(size=(count, 3)))
        yield f"from {distance:.0e} radii away", ball, inside - distance * direction, direction, np.full(count, 2)
    utm = ball.copy()
    utm.apply_translation([5e5, 5.2e6, 100.0])
    direction = unit(rng.normal(size=(count, 3)))
    yield "at UTM coordinates", utm, inside - 3 * direction + [5e5, 5.2e6, 100.0], direction, np.full(count, 2)


def wrong_answers(made, options, write):
    rng = np.random.default_rng(1)
    print("\n## Wrong answers\n\nRays whose first query misses a hit or finds one where there is none / whose number of hits is wrong.\n")
    print("| case | rays | " + " | ".join(made) + " |\n|---|--:|" + "--:|" * len(made))
    for name, mesh, origins, directions, counts in cases(rng, options.judged):
        row = []
        for engine, make in made.items():
            asked = make(mesh)
            hit = int((asked.hit(origins, directions) != (counts > 0)).sum())
            count = int((asked.counts(origins, directions) != counts).sum())
            row.append(f"{hit} / {count}")
            write(kind="wrong", case=name, engine=engine, rays=len(origins), hit=hit, count=count)
        print(f"| {name} | {len(origins)} | " + " | ".join(row) + " |", flush=True)


def workloads(mesh, count, rng):
    middle, radius = mesh.bounds.mean(axis=0), np.linalg.norm(mesh.extents) / 2
    side = int(count**0.5)
    eye = middle + radius * np.array([0.9, 0.6, 2.0])
    forward = unit(middle - eye)
    right = unit(np.cross(forward, [0.0, 1.0, 0.0]))
    x, y = np.meshgrid(*[np.linspace(-0.45, 0.45, side)] * 2)
    primary = forward + x[..., None] * right + y[..., None] * np.cross(right, forward)
    primary = np.tile(eye, (side * side, 1)), primary.reshape(-1, 3)
    ends = middle + radius * unit(rng.normal(size=(2, count, 3)))
    random = ends[0], ends[1] - ends[0]
    points = rng.uniform(*mesh.bounds, (count // 4, 3))
    return primary, random, points


def speeds(made, options, write):
    print("\n## Speed\n\nMillions of rays or points a second, medians.\n")
    meshes = options.mesh or ["icosphere"]
    for path in meshes:
        mesh = trimesh.creation.icosphere(subdivisions=6) if path == "icosphere" else trimesh.load(path, force="mesh")
        name = Path(path).stem
        primary, random, points = workloads(mesh, options.rays, np.random.default_rng(0))
        print(f"{name}, {len(mesh.faces)} triangles\n")
        print("| query | " + " | ".join(made) + " |\n|---|" + "--:|" * len(made))
        asked = {engine: make(mesh) for engine, make in made.items()}

        def arguments(engine, rays):
            return rays if isinstance(engine, ThroughTrimesh) else (ThroughOpen3D.rays(*rays),)

        queries = {
            "primary, first hit": ("first", primary),
            "random, first hit": ("first", random),
            "random, any hit": ("any", random),
            "random, all hits": ("all", random),
            "inside": ("inside", points),
            "closest point": ("closest", points),
        }
        for query, (method, data) in queries.items():
            calls, times = {}, {}
            for engine, asks in asked.items():
                if not hasattr(asks, method):
                    continue
                if data is points:
                    given = (data,) if isinstance(asks, ThroughTrimesh) else (data.astype(np.float32),)
                else:
                    given = arguments(asks, data)
                calls[engine] = (getattr(asks, method), given)
                times[engine] = []
                calls[engine][0](*(g[:100] for g in given))
            for _ in range(options.repeats):
                for engine, (call, given) in calls.items():
                    start = time.perf_counter()
                    call(*given)
                    times[engine].append(time.perf_counter() - start)
            row = []
            for engine in made:
                if engine not in times:
                    row.append("")
                    continue
                rows = len(calls[engine][1][0])
                rate = rows / statistics.median(times[engine]) / 1e6
                row.append(f"{rate:.2f}")
                write(kind="speed", mesh=name, triangles=len(mesh.faces), query=query, engine=engine, rows=rows, seconds=times[engine])
            print(f"| {query} | " + " | ".join(row) + " |", flush=True)
        print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mesh", nargs="*", help="files that trimesh reads; a sphere of 81 920 triangles by default")
    parser.add_argument("--rays", type=int, default=1_000_000, help="rays of each speed")
    parser.add_argument("--judged", type=int, default=20_000, help="rays of each case that is judged")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--out", type=Path, help="a file that gets lines of JSON")
    options = parser.parse_args()
    made, missing = engines()
    versions = {}
    for package in ("kd", "trimesh", "embreex", "open3d", "numpy"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    out = options.out.open("w") if options.out else None

    def write(**line):
        if out:
            print(json.dumps(line), file=out, flush=True)

    write(kind="setup", versions=versions, cores=os.cpu_count(), machine=platform.processor() or platform.machine(), rays=options.rays, missing=missing)
    print(", ".join(f"{name} {version}" for name, version in versions.items() if version) + f"; {os.cpu_count()} cores")
    for what in missing:
        print(f"missing: {what}")
    wrong_answers(made, options, write)
    speeds(made, options, write)


if __name__ == "__main__":
    main()
