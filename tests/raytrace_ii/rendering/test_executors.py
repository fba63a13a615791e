"""Pictures by threads, processes and a dask cluster: equal to the bit, also after the death of a worker."""

import multiprocessing
import os
import pickle
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ii_core import IIPicture, preset
from ii_core.base import executors as calls
from raytrace_ii import Scene, load_scene, render
from raytrace_ii.cli import cluster as cluster_option
from raytrace_ii.rendering import executors, job
from raytrace_ii.tracing.packing import packed
from tests.support.trace_scenes import body, hall, wall

ROOT = Path(__file__).parents[3]
CAMERA = preset("setup1", scale=64)  # 128×64 px, 8×4 lenses
SUPPORT = ("depth", "normal", "object_id", "ray_length", "disparity", "samples")
OPTIONS = {"samples": (4, 16), "error": 4.0, "seed": 2, "support": SUPPORT}


@pytest.fixture(scope="module")
def scene():
    return hall()


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    monkeypatch.setattr(job, "TILE_RAYS", 512)  # 16 blocks of two lenses


@pytest.fixture(scope="module")
def whole(scene):
    return render(scene, CAMERA, workers=1, **OPTIONS)


def assert_same(a, b):
    np.testing.assert_array_equal(a.picture.pixels, b.picture.pixels)
    for name in SUPPORT:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.stats.rays == b.stats.rays and a.stats.samples == b.stats.samples


def test_threads_of_ones_own(scene, whole):
    with ThreadPoolExecutor(3) as pool:
        assert_same(whole, render(scene, CAMERA, executor=pool, **OPTIONS))
        assert pool.submit(int, 1).result() == 1, "the executor stays open"


@pytest.mark.slow
def test_processes_read_the_scene_once_and_a_broken_pool_is_one_line(scene, whole, monkeypatch):
    # forkserver: changes in the parent do not reach the children, as on other systems
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("forkserver")) as pool:
        assert_same(whole, render(scene, CAMERA, executor=pool, **OPTIONS))
        assert pool.submit(_opened).result() == 1

        def kill(done, total):
            for pid in list(pool._processes):
                os.kill(pid, signal.SIGKILL)

        with pytest.raises(OSError, match=r"worker processes died, .* while it rendered: the picture is not"):
            render(scene, preset("setup1", scale=8), executor=pool, progress=kill)


def _opened():
    return len(calls._opened)


@pytest.mark.slow
def test_a_cluster_of_processes_loses_nothing_when_one_is_killed(scene, whole, run, tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        assert len(set(pids)) == 2 and os.getpid() not in pids
        killed = []

        def kill(done, total):
            if done == 1:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(done)

        shot = render(scene, CAMERA, executor=client, progress=kill, **OPTIONS)
        assert killed
        assert_same(whole, shot)
        assert_same(whole, render(scene, CAMERA, executor=client.get_executor(), **OPTIONS))
        command = ("render", "objects", "--scale", 128, "-o", tmp_path / "p.png", "--dask", cluster.scheduler_address)
        code, _, error = run(*command)
        assert code == 0, error
        expected = render(load_scene("objects"), preset("setup1", scale=128)).picture
        np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, expected.pixels)


def test_a_cluster_in_this_process_gives_the_same_picture(scene, whole):
    distributed = pytest.importorskip("distributed")
    options = {"processes": False, "dashboard_address": None, "silence_logs": 50}
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert_same(whole, render(scene, CAMERA, executor=client, **OPTIONS))


@pytest.fixture
def cluster():
    """A dask scheduler and workers as processes of their own: ``start(tree)`` adds a worker that runs that tree."""
    pytest.importorskip("distributed")
    from distributed import Client

    processes = []

    def start(module, *arguments, tree=ROOT):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--no-dashboard"]
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        processes.append(subprocess.Popen(command, env=environment, cwd=tree, **quiet))
        return processes[-1]

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    scheduler = start("dask_scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    client = Client(address, timeout=60, set_as_default=False)

    def add(tree=ROOT):
        count = len(client.scheduler_info(n_workers=-1)["workers"])
        start("dask_worker", address, "--nthreads", "1", "--no-nanny", tree=tree)
        client.wait_for_workers(count + 1, timeout=60)

    try:
        yield SimpleNamespace(scheduler=scheduler, client=client, address=address, add=add)
    finally:
        for process in processes:
            process.kill()
            process.wait()
        client.close(timeout=1)


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused_by_name(cluster, run, refused, tmp_path):
    """On b1dc540 its blocks went into the picture: a quarter of the pixels differed."""
    other = tmp_path / "other"
    for package in ("raytrace_ii", "ii_core", "assets"):
        shutil.copytree(ROOT / package, other / package, ignore=shutil.ignore_patterns("__pycache__"))
    kernel = other / "raytrace_ii" / "tracing" / "kernels" / "way.py"
    kernel.write_text(kernel.read_text() + "\n# brighter\n")
    cluster.add()
    command = ("render", "objects", "--scale", 128, "--dask", cluster.address, "-o")
    code, _, error = run(*command, tmp_path / "good.png")
    assert code == 0, error
    cluster.add(other)
    result = run(*command, tmp_path / "p.png")
    refused(result, "is refused: code ")
    assert re.search(r"dask worker tcp://\S+ is refused: code \w{12} there, \w{12} here;", result[2])
    assert not (tmp_path / "p.png").exists()


@pytest.mark.parametrize("name", ["code", "embreex", "numba", "numpy"])
def test_a_worker_that_differs_renders_no_block(scene, name, monkeypatch, tmp_path):
    """This is the only check of a worker that joins late."""
    ours = executors.identity()
    assert set(ours) == {"code", "embreex", "numba", "numpy"} and len(ours["code"]) == 12
    monkeypatch.setattr(executors, "identity", lambda: {**ours, name: "0"})
    with pytest.raises(OSError, match=rf"worker process \d+ is refused: {name} 0 there, {ours[name]} here"):
        calls.in_process(str(tmp_path / "no.job"), (slice(0, 1), slice(0, 1)), executors.identity, ours)


@pytest.mark.slow
def test_a_lost_scheduler_is_one_line(cluster, scene):
    cluster.add()

    def kill(done, total):
        if done == 1:
            cluster.scheduler.kill()
            cluster.scheduler.wait()

    with pytest.raises(OSError, match=r"^the dask scheduler was lost while it rendered: .* not finished$"):
        render(scene, preset("setup1", scale=4), executor=cluster.client, progress=kill)


def test_a_scene_travels_without_its_trees(scene):
    before = pickle.dumps(scene)
    assert packed(scene) is packed(scene)
    again = pickle.loads(pickle.dumps(scene))
    assert len(pickle.dumps(scene)) == len(before) and packed(again) is not packed(scene)
    small = preset("setup1", scale=128)
    np.testing.assert_array_equal(render(scene, small).picture.pixels, render(again, small).picture.pixels)


def test_few_blocks_are_under_way_at_a_time(scene):
    """A slow first block delays all but a few others, at any size of the picture."""

    class Counting(ThreadPoolExecutor):
        most = now = 0

        def submit(self, call, *arguments):
            future = super().submit(call, *arguments)
            self.now += 1
            self.most = max(self.most, self.now)
            result = future.result

            def counted(timeout=None):
                self.now -= 1
                return result(timeout)

            future.result = counted
            return future

    with Counting(2) as pool:
        render(scene, preset("setup1", scale=32), executor=pool, samples=(4, 4))
    assert pool.most == 2 * calls.AHEAD


def test_an_error_or_an_interrupt_stops_all_work(scene):
    def stop(done, total):
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(KeyboardInterrupt):
            render(scene, CAMERA, executor=pool, progress=stop)
        gate = pool.submit(threading.get_ident)
        assert gate.result(timeout=10), "the pool is free again"


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"executor": 4}, "executor is 4: a concurrent.futures executor or a dask client is needed"),
        ({"executor": Future()}, "a concurrent.futures executor or a dask client"),
        ({"executor": ThreadPoolExecutor(1), "workers": 2}, "workers is 2: an executor has its own"),
    ],
)
def test_invalid_executors_are_refused(wrong, says):
    with pytest.raises(ValueError, match=says):
        render(Scene(bodies=[body(wall(5))]), CAMERA, **wrong)


def test_a_missing_cluster_is_one_line(run, refused, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster_option, "ANSWER_SECONDS", 0.2)
    command = ("render", "objects", "--scale", 128, "-o", tmp_path / "p.png", "--dask")
    refused(run(*command, "127.0.0.1:1"), "no dask scheduler answers at 127.0.0.1:1")
    refused(run(*command, "127.0.0.1:1", "--workers", 2), "--workers is for threads of this machine")
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(run(*command, "127.0.0.1:1"), "dask is not installed: pip install 'raytrace-ii[dask]'")
    assert list(tmp_path.iterdir()) == []
