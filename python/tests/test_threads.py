"""Threads, the interpreter's lock, signals, progress, processes."""

import _thread
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import kd
import meshes


def bytes_of(hits):
    return b"".join(np.ascontiguousarray(a).tobytes() for a in (hits.t, hits.triangle, hits.u, hits.v))


def test_answers_do_not_depend_on_the_number_of_threads():
    vertices, faces = meshes.soup(3000)
    origins, directions = meshes.rays(70_000)
    points = origins[:5000]
    answers = set()
    for threads in (1, 2, 3, None):
        tree = kd.KdTree(vertices, faces, threads=threads)
        assert tree.threads == threads
        lists, crossings = tree.hits(origins, directions), tree.crossings(origins, directions)
        closest = tree.closest_point(points)
        answers.add(
            bytes_of(tree.intersect(origins, directions))
            + bytes_of(lists) + lists.offsets.tobytes()
            + bytes_of(crossings) + crossings.offsets.tobytes()
            + tree.occluded(origins, directions).tobytes()
            + tree.count_hits(origins, directions).tobytes()
            + closest.point.tobytes() + closest.triangle.tobytes()
            + tree.contains(points).tobytes() + tree.signed_distance(points).tobytes()
            + tree.winding_number(points).tobytes()
            + tree.triangles_in_sphere(points, 0.1).triangle.tobytes()
        )  # fmt: skip
    assert len(answers) == 1


def test_with_threads_shares_the_tree():
    tree = kd.KdTree(*meshes.soup(100))
    one = tree.with_threads(1)
    assert one.threads == 1 and tree.threads is None and len(one) == 100
    with pytest.raises(ValueError, match="threads: "):
        tree.with_threads(0)


def test_many_threads_of_python_share_a_tree():
    tree = kd.KdTree(*meshes.soup(2000))
    origins, directions = meshes.rays(20_000)
    expected = bytes_of(tree.intersect(origins, directions))
    answers = [None] * 8

    def ask(i):
        answers[i] = bytes_of(tree.with_threads(1 + i % 2).intersect(origins, directions))

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(len(answers))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(answers) == {expected}


def test_other_threads_run_during_a_query():
    tree = kd.KdTree(*meshes.soup(3000, size=1.0), threads=1)
    origins, directions = meshes.rays(30_000)
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    start = time.perf_counter()
    tree.hits(origins, directions)
    end = time.perf_counter()
    stop.set()
    ticker.join()
    during = [at for at in ticks if start < at < end]
    assert len(during) > 5, f"{len(during)} ticks in {end - start:.3f} s"


def test_arguments_may_change_during_a_query():
    # The query has read them before it released the lock, or reads the next chunk: never a crash.
    tree = kd.KdTree(*meshes.soup(3000, size=0.5))
    origins, directions = meshes.rays(300_000)
    stop = threading.Event()

    def scribble():
        rng = np.random.default_rng(1)
        while not stop.is_set():
            directions[rng.integers(len(directions))] = np.nan
            origins[:1000] *= -1

    writer = threading.Thread(target=scribble)
    writer.start()
    for _ in range(3):
        assert len(tree.intersect(origins, directions)) == 300_000
    stop.set()
    writer.join()


def test_progress_goes_from_zero_to_one():
    vertices, faces = meshes.soup(150_000, size=0.02)
    seen = []
    kd.KdTree(vertices, faces, preset="best", layout="binary", threads=1, progress=seen.append)
    assert seen[0] == 0.0 and seen[-1] == 1.0 and seen == sorted(seen)
    assert len(seen) > 2, "a build of some time reports on the way"


def test_an_exception_of_progress_ends_the_build():
    vertices, faces = meshes.soup(150_000, size=0.02)

    class Enough(Exception):
        pass

    def stop(done):
        if done > 0.0:
            raise Enough

    with pytest.raises(Enough):
        kd.KdTree(vertices, faces, preset="best", layout="binary", progress=stop)
    with pytest.raises(TypeError):
        kd.KdTree(vertices[:3], faces[:1], progress=5)


def test_ctrl_c_ends_a_build():
    vertices, faces = meshes.soup(400_000, size=0.05)
    begun = time.perf_counter()
    kd.KdTree(vertices[: 3 * 40_000], faces[:40_000], preset="best", layout="binary", threads=1)
    tenth = time.perf_counter() - begun
    timer = threading.Timer(0.1, _thread.interrupt_main)
    timer.start()
    begun = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        kd.KdTree(vertices, faces, preset="best", layout="binary", threads=1)
    took = time.perf_counter() - begun
    timer.join()
    assert took < 5 * tenth + 1.0, f"{took:.2f} s, a tenth of the build takes {tenth:.2f} s"


def ask_in_child(queue, tree, origins, directions):
    queue.put(bytes_of(tree.intersect(origins, directions)))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own():
    tree = kd.KdTree(*meshes.soup(2000))
    origins, directions = meshes.rays(50_000)
    expected = bytes_of(tree.intersect(origins, directions))
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=ask_in_child, args=(queue, tree, origins, directions))
    child.start()
    assert queue.get(timeout=60) == expected
    child.join(60)
    assert child.exitcode == 0
    assert bytes_of(tree.intersect(origins, directions)) == expected


def test_a_spawned_process_gets_a_pickle():
    tree = kd.KdTree(*meshes.soup(200))
    origins, directions = meshes.rays(2000)
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    child = context.Process(target=ask_in_child, args=(queue, tree, origins, directions))
    child.start()
    assert queue.get(timeout=60) == bytes_of(tree.intersect(origins, directions))
    child.join(60)


@pytest.mark.skipif(not hasattr(signal, "SIGINT") or sys.platform == "win32", reason="POSIX signals")
def test_a_signal_between_chunks_ends_a_query():
    program = """
import numpy as np, os, signal, threading, kd, meshes
tree = kd.KdTree(*meshes.soup(3000, size=1.0), threads=1)
origins, directions = meshes.rays(100_000)
origins, directions = np.tile(origins, (40, 1)), np.tile(directions, (40, 1))
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    tree.count_hits(origins, directions)
except KeyboardInterrupt:
    print("ended")
"""
    environment = dict(os.environ, PYTHONPATH=os.path.dirname(__file__))
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, timeout=120)
    assert found.stdout.strip() == "ended", found.stderr
