"""Files and pickles."""

import copy
import pickle

import numpy as np
import pytest

import kd
import meshes


def same(a, b):
    origins, directions = meshes.rays(3000)
    x, y = a.intersect(origins, directions), b.intersect(origins, directions)
    assert x.hit.any()
    return np.array_equal(x.t, y.t) and np.array_equal(x.triangle, y.triangle)


def test_save_and_load(tmp_path):
    tree = kd.KdTree(*meshes.soup(500))
    path = tmp_path / "soup.kd"
    tree.save(path)
    loaded = kd.KdTree.load(str(path), threads=1)
    assert same(tree, loaded) and np.array_equal(loaded.faces, tree.faces) and loaded.threads == 1


def test_files_that_are_none(tmp_path):
    path = tmp_path / "none.kd"
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(ValueError, match="none.kd"):
        kd.KdTree.load(path)
    with pytest.raises(OSError):
        kd.KdTree.load(tmp_path)
    tree = kd.KdTree(*meshes.soup(5))
    with pytest.raises(FileNotFoundError):
        tree.save(tmp_path / "no" / "folder.kd")


def test_open(tmp_path):
    tree = kd.KdTree(*meshes.soup(500), preset="best", layout="binary")
    path = tmp_path / "soup.kd"
    tree.save(path)
    for opened in (kd.KdTree.open(path), kd.KdTree.open(str(path), verify=False, threads=1)):
        assert same(tree, opened) and np.array_equal(opened.vertices, tree.vertices)
        assert (opened.preset, opened.layout, opened.rounding) == ("best", "binary", None)
    assert opened.threads == 1
    kd.KdTree(*meshes.soup(5)).save(path)
    assert same(tree, opened)


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "soup.kd"
    kd.KdTree(*meshes.soup(50)).save(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    for read in (kd.KdTree.open, kd.KdTree.load):
        with pytest.raises(ValueError, match="soup.kd.*damaged"):
            read(path)
        with pytest.raises(FileNotFoundError, match="gone.kd"):
            read(tmp_path / "gone.kd")


def test_a_pickle_of_an_opened_tree_is_its_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tree = kd.KdTree(*meshes.soup(500))
    tree.save("soup.kd")
    data = pickle.dumps(kd.KdTree.open("soup.kd", threads=2))
    assert len(data) < 500
    monkeypatch.chdir("/")
    again = pickle.loads(data)
    assert same(tree, again) and again.threads == 2
    (tmp_path / "soup.kd").unlink()
    with pytest.raises(FileNotFoundError, match="soup.kd"):
        pickle.loads(data)


def test_files_keep_the_origin(tmp_path):
    vertices, faces = meshes.soup(50)
    tree = kd.KdTree(vertices.astype(np.float64) + 1e7, faces)
    tree.save(tmp_path / "far.kd")
    loaded, opened = kd.KdTree.load(tmp_path / "far.kd"), kd.KdTree.open(tmp_path / "far.kd")
    for again in (loaded, opened, pickle.loads(pickle.dumps(loaded)), pickle.loads(pickle.dumps(opened))):
        assert again.origin == tree.origin and np.array_equal(again.vertices, tree.vertices)


@pytest.mark.parametrize("again", [lambda tree: pickle.loads(pickle.dumps(tree)), copy.copy, copy.deepcopy])
def test_pickle_and_copy(again):
    vertices, faces = meshes.soup(500)
    tree = kd.KdTree(vertices.astype(np.float64) * 1.1, faces, "fast", "binary", threads=2)
    other = again(tree)
    assert same(tree, other)
    assert (other.preset, other.layout, other.threads) == ("fast", "binary", 2)
    assert other.origin == tree.origin and other.rounding == tree.rounding


def test_results_can_be_pickled():
    tree = kd.KdTree(*meshes.soup(500))
    origins, directions = meshes.rays(300)
    hits, lists = tree.intersect(origins, directions), tree.hits(origins, directions)
    hits_again, lists_again = pickle.loads(pickle.dumps((hits, lists)))
    assert np.array_equal(hits_again.t, hits.t) and np.array_equal(hits_again.hit, hits.hit)
    assert np.array_equal(lists_again.offsets, lists.offsets) and np.array_equal(lists_again.u, lists.u)
