"""How far one sees from ten thousand places of a city, by sweeps of a LiDAR on the workers of a Dask cluster.

The tree is built once and saved; every worker opens the file. Rays are made where they are traced: the scheduler sees one small block of
places for each task, and gets one number for each place.

    python sight_of_a_city.py                       # a generated city
    python sight_of_a_city.py city.ply sight.png    # a mesh, with z upwards and the same unit as a meter

Needs the packages dask[array], distributed, pillow, and trimesh for a mesh.
"""

import argparse
import tempfile
import time
from pathlib import Path

import dask.array as da
import numpy as np
from distributed import Client, LocalCluster
from PIL import Image

import kd
import kd.dask

EYE = 1.7  # meters above the street
ROOF = 3.0  # what is higher above the lowest ground is a building
REACH = 300.0  # meters that the LiDAR sees
CHANNELS, STEPS = 8, 720  # elevations from -2 to 12 degrees, and directions around


def generated_city(blocks=24, seed=7):
    """Towers on a square of streets."""
    random = np.random.default_rng(seed)
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    sides = np.array([[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [4, 5, 7, 6]])
    towers = np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
    place = 40.0 * np.stack(np.meshgrid(np.arange(blocks), np.arange(blocks)), -1).reshape(-1, 2)
    size = random.uniform(15, 34, place.shape)
    height = random.gamma(3.0, 6.0, len(place)) * (random.random(len(place)) < 0.85)
    start = place + random.uniform(0, 40 - size)
    low = np.column_stack([start, np.zeros(len(place))])
    extent = np.column_stack([size, height])
    vertices = (low[:, None] + corners * extent[:, None]).reshape(-1, 3)
    faces = (8 * np.arange(len(place))[:, None, None] + towers).reshape(-1, 3)
    end = 40.0 * blocks
    ground = np.array([[-end, -end, 0], [2 * end, -end, 0], [2 * end, 2 * end, 0], [-end, 2 * end, 0]])
    faces = np.concatenate([faces, len(vertices) + np.array([[0, 1, 2], [0, 2, 3]])])
    return np.concatenate([vertices, ground]), faces


def sweep():
    """The unit directions of a sweep, step by step."""
    elevation = np.radians(np.linspace(-2.0, 12.0, CHANNELS))[None, :]
    turn = np.linspace(0.0, 2 * np.pi, STEPS, endpoint=False)[:, None]
    return np.stack(
        [np.cos(turn) * np.cos(elevation), np.sin(turn) * np.cos(elevation), np.sin(elevation) + 0 * turn], -1
    ).reshape(-1, 3)


def origins_of(places):
    """The origins of the rays of a block of places."""
    return np.repeat(places, CHANNELS * STEPS, axis=0)


def directions_of(places):
    """The directions of the rays of a block of places."""
    return np.tile(sweep(), (len(places), 1))


def seen_area(distances):
    """The area around each place that the sweep sees, in square meters: in each direction as far as its farthest channel."""
    reach = np.minimum(distances, REACH).reshape(-1, STEPS, CHANNELS).max(axis=2)
    return (reach.astype(float) ** 2).sum(axis=1) * np.pi / STEPS


def places_in(tree, side):
    """A grid of places over the middle of the city, at the height of eyes, and whether each is in a street."""
    low, high = np.quantile(tree.vertices, [0.1, 0.9], axis=0)
    axes = [np.linspace(low[axis], high[axis], side) for axis in (0, 1)]
    x, y = (grid.ravel() for grid in np.meshgrid(*axes))
    top = tree.vertices[:, 2].max() + 1.0
    from_above = np.column_stack([x, y, np.full(len(x), top)])
    down = np.tile([0.0, 0.0, -1.0], (len(x), 1))
    ground = top - tree.intersect(from_above, down).t.astype(float)
    street = np.isfinite(ground) & (ground < np.quantile(ground[np.isfinite(ground)], 0.02) + ROOF)
    return np.column_stack([x, y, np.where(street, ground, 0.0) + EYE]), street


def rays_per_place(block):
    return tuple(rows * CHANNELS * STEPS for rows in block)


def picture(area, street, side):
    """Streets from dark to bright by the logarithm of what is seen; buildings black."""
    bright = np.log(np.maximum(area, 1.0))
    low, high = np.quantile(bright[street], [0.01, 0.99])
    value = np.clip((bright - low) / (high - low), 0.0, 1.0)[:, None]
    color = (1 - value) * [40, 30, 90] + value * [255, 225, 120]
    color[~street] = 12
    pixels = color.reshape(side, side, 3)[::-1].astype(np.uint8)
    return Image.fromarray(pixels.repeat(6, axis=0).repeat(6, axis=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", nargs="?", help="a file that trimesh reads [default: a generated city]")
    parser.add_argument("picture", nargs="?", default="sight_of_a_city.png")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--side", type=int, default=100, help="places on each side of the grid")
    arguments = parser.parse_args()
    if arguments.mesh:
        import trimesh

        mesh = trimesh.load(arguments.mesh, process=False, force="mesh")
        vertices, faces = mesh.vertices, mesh.faces
    else:
        vertices, faces = generated_city()

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "city.kd"
        tree = kd.KdTree(vertices, faces, preset="best")
        tree.save(path)
        places, street = places_in(tree, arguments.side)
        with LocalCluster(n_workers=arguments.workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster):
                start = time.perf_counter()
                blocks = da.from_array(places, chunks=(50, 3))
                chunks = (rays_per_place(blocks.chunks[0]), (3,))
                origins = blocks.map_blocks(origins_of, chunks=chunks, dtype=float)
                directions = blocks.map_blocks(directions_of, chunks=chunks, dtype=float)
                hits = kd.dask.Tree(path).intersect(origins, directions, t_max=REACH)
                area = hits.t.map_blocks(seen_area, chunks=(blocks.chunks[0],), dtype=float).compute()
                seconds = time.perf_counter() - start
        rays = len(places) * CHANNELS * STEPS
        print(f"{len(places)} places, {rays} rays, {arguments.workers} workers: {rays / seconds * 1e-6:.2f} million rays per second")
        print(f"{path.stat().st_size} bytes are mapped by each worker; {len(blocks.chunks[0])} tasks of {50 * CHANNELS * STEPS} rays")
        print(f"in streets one sees {np.median(area[street]):.0f} square meters (median), at most {area[street].max():.0f}")
    picture(area, street, arguments.side).save(arguments.picture)


if __name__ == "__main__":
    main()
