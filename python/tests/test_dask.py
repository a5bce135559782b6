"""Dask arrays: answers are those of one tree, whatever the blocks and whoever answers them."""

import os
import signal
import time

import numpy as np
import pytest

import kd
import meshes

da = pytest.importorskip("dask.array")
distributed = pytest.importorskip("distributed")
kd_dask = pytest.importorskip("kd.dask")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "soup.kd"
    kd.KdTree(*meshes.soup(500)).save(path)
    return path


def rays(number, chunks):
    origins, directions = meshes.rays(number)
    return origins, directions, da.from_array(origins, chunks=chunks), da.from_array(directions, chunks=number)


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            yield client


@pytest.mark.parametrize("chunks", [(1000, 3), ((1, 999, 2000), 3), (700, 2)])
def test_rays(file, chunks):
    tree, here = kd_dask.Tree(file), kd.KdTree.load(file)
    origins, directions, blocks_of_origins, blocks_of_directions = rays(3000, chunks)
    arrays = blocks_of_origins, blocks_of_directions
    t_max = np.linspace(0.1, 3.0, 3000)
    expected = here.intersect(origins, directions, t_max=t_max, culling="back")
    hits = tree.intersect(*arrays, t_max=da.from_array(t_max, chunks=500), culling="back")
    assert hits.t.chunks[0] == hits.triangle.chunks[0] and sum(hits.t.chunks[0]) == 3000
    assert expected.hit.any() and not expected.hit.all()
    for name in ("t", "triangle", "u", "v", "hit"):
        found, wanted = getattr(hits, name), getattr(expected, name)
        assert found.dtype == wanted.dtype, name
        np.testing.assert_array_equal(found.compute(scheduler="threads"), wanted)
    occluded = tree.occluded(*arrays, t_min=0.5)
    assert occluded.dtype == bool
    np.testing.assert_array_equal(occluded.compute(), here.occluded(origins, directions, t_min=0.5))
    np.testing.assert_array_equal(tree.count_hits(*arrays).compute(), here.count_hits(origins, directions))


def test_points(file):
    tree, here = kd_dask.Tree(file, verify=False, threads=None), kd.KdTree.load(file)
    points = meshes.rays(2000)[0]
    blocks = da.from_array(points, chunks=(300, 1))
    nearest, expected = tree.closest_point(blocks, 0.3), here.closest_point(points, 0.3)
    for name in nearest._fields:
        found, wanted = getattr(nearest, name), np.asarray(getattr(expected, name))
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape), name
        np.testing.assert_array_equal(found.compute(), wanted)
    for query in ("contains", "signed_distance", "winding_number"):
        found, wanted = getattr(tree, query)(blocks), getattr(here, query)(points)
        assert found.dtype == wanted.dtype
        np.testing.assert_array_equal(found.compute(), wanted)


def test_workers_open_the_file_once(file, cluster):
    tree, here = kd_dask.Tree(file), kd.KdTree.load(file)
    origins, directions, *arrays = rays(5000, (100, 3))
    hits = tree.intersect(*arrays)
    np.testing.assert_array_equal(hits.t.compute(), here.intersect(origins, directions).t)
    opened = cluster.run(lambda: len(__import__("kd.dask").dask._trees))
    assert set(opened.values()) <= {0, 1} and 1 in opened.values()


def test_a_worker_that_is_killed_loses_nothing(file, cluster):
    tree, here = kd_dask.Tree(file), kd.KdTree.load(file)
    origins, directions, *arrays = rays(4000, (50, 3))

    def slow(block):
        time.sleep(0.05)
        return block

    answers = tree.intersect(arrays[0].map_blocks(slow, dtype=arrays[0].dtype), arrays[1])
    future = cluster.compute(answers.t)
    time.sleep(0.7)
    assert not future.done()
    victim = next(iter(cluster.run(os.getpid).values()))
    os.kill(victim, signal.SIGKILL)
    np.testing.assert_array_equal(future.result(timeout=120), here.intersect(origins, directions).t)
    assert victim not in cluster.run(os.getpid).values()


def test_what_a_worker_lacks_is_said(file, cluster, monkeypatch):
    origins, directions, *arrays = rays(100, (50, 3))
    tree = kd_dask.Tree(file)
    kd.KdTree(*meshes.soup(5)).save(file)
    with pytest.raises(ValueError, match="soup.kd: another file on this worker"):
        tree.intersect(*arrays).t.compute()
    tree = kd_dask.Tree(file)
    file.unlink()
    with pytest.raises(FileNotFoundError, match="soup.kd"):
        tree.intersect(*arrays).t.compute()
    with pytest.raises(FileNotFoundError, match="soup.kd"):
        kd_dask.Tree(file)
    kd.KdTree(*meshes.soup(5)).save(file)
    monkeypatch.setattr(kd, "__version__", "9.9.9")
    with pytest.raises(RuntimeError, match="on this worker, kd 9.9.9 where"):
        kd_dask.Tree(file).intersect(*arrays).t.compute()


def test_wrong_arguments(file):
    tree = kd_dask.Tree(file)
    origins, directions, *arrays = rays(100, (50, 3))
    for arguments, message in [
        ((arrays[0][:, :2], arrays[1]), r"origins: expected an array of shape \(N, 3\), got shape \(100, 2\)"),
        ((arrays[0], arrays[1][:50]), "directions: 50 rows, expected 100"),
        ((arrays[0], arrays[1], arrays[0]), r"t_min: expected a number or an array of shape \(N,\)"),
        ((arrays[0], arrays[1], np.zeros(3)), "t_min: 3 rows, expected 100"),
    ]:
        with pytest.raises(ValueError, match=message):
            tree.intersect(*arguments)
    bad = origins.copy()
    bad[70, 1] = np.nan
    assert not tree.occluded(da.from_array(bad, chunks=(50, 3)), arrays[1]).compute()[70]
    assert repr(tree) == f"<kd.dask.Tree: {file}>"
