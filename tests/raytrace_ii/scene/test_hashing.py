"""Content hashes of scenes that follow one another."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from raytrace_ii import load_scene
from raytrace_ii.scene import hashing
from raytrace_ii.scene.hashing import SceneHashes


@pytest.fixture(scope="module")
def scene():
    return load_scene("cuboid")


def moved(scene, number, what="vertices"):
    """The scene with one changed value in an array of one body, the other arrays shared."""
    bodies = list(scene.bodies)
    values = getattr(bodies[number], what).copy()
    values.reshape(-1)[-1] += 1e-9 if values.dtype.kind == "f" else -1
    bodies[number] = replace(bodies[number], **{what: values})
    return replace(scene, bodies=bodies)


def test_the_hash_is_that_of_the_content_whatever_came_before(scene):
    others = [moved(scene, i, what) for i, body in enumerate(scene.bodies) for what in ("vertices", "faces")]
    others.append(replace(scene, ambient=(0.5, 0.5, 0.25)))
    every = [scene, *others]
    alone = [SceneHashes().of(one) for one in every]
    assert len(set(alone)) == len(every)
    hashes = SceneHashes()
    for i in (0, 1, 0, *range(len(every))):
        assert hashes.of(every[i]) == alone[i]
    copied = replace(scene, bodies=[replace(b, vertices=np.array(b.vertices)) for b in scene.bodies])
    assert hashes.of(copied) == alone[0]


def test_shared_arrays_are_hashed_once_and_kept_of_one_scene(scene, monkeypatch):
    sizes, sha256 = [], hashlib.sha256

    def counted(*data):
        sizes.append(sum(np.asarray(one).nbytes for one in data))
        return sha256(*data)

    monkeypatch.setattr(hashing.hashlib, "sha256", counted)
    hashes, later = SceneHashes(), moved(scene, 0)
    hashes.of(scene)
    del sizes[:]
    hashes.of(later)
    assert sum(sizes) == later.bodies[0].vertices.nbytes
    del sizes[:]
    hashes.of(scene)  # memory holds the arrays of the last scene alone: those that moved are hashed again
    assert sum(sizes) == scene.bodies[0].vertices.nbytes
