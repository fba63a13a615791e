"""Arguments of wrong type: TypeError or ValueError that names the argument, before any work."""

from dataclasses import fields
from functools import partial

import numpy as np
import pytest

from ii_core import preset
from raytrace_ii import RenderOptions, load_scene, render, render_to, trace
from raytrace_ii.rendering.options import RenderKeywords
from raytrace_ii.rendering.render_sets import render_set

CAMERA = preset("setup1", scale=128)


class Odd:
    """A class that no function accepts."""


ODD = [
    7,
    -1.5,
    "text",
    b"bytes",
    None,
    True,
    [],
    {},
    (),
    {1: 2},
    Odd(),
    Odd,
    np.zeros(3),
    [None],
    ["x"],
    10**400,
    {3},
]
# Values of the list that an argument takes.
TAKEN = {
    "samples": [7, None, True],
    "seed": [7, True],
    "noise": [7, True],
    "workers": [7, None, True],
    "executor": [None],
    "pose": [None],
    "progress": [None, True, Odd],  # True prints a line
    "support": [[], {}, (), None],
    "picture": ["text", None],
}
NAMED = {"dtype": ("dtype", "pixel type"), "support": ("support",), "name": ("name", "scene")}


@pytest.fixture(scope="module")
def scene():
    return load_scene("cuboid")


def wrong(argument):
    taken = TAKEN.get(argument, [])
    return [value for value in ODD if not any(type(value) is type(t) and value == t for t in taken)]


def check(call, argument, value):
    with pytest.raises((TypeError, ValueError)) as caught:
        call(value)
    said = str(caught.value)
    assert any(name in said for name in NAMED.get(argument, (argument,))), said


RENDER = ("scene", "camera", "samples", "seed", "noise", "audit", "dtype", "workers", "executor", "pose", "progress")


@pytest.mark.parametrize("argument", [*RENDER, "support"])
def test_render(scene, argument):
    arguments = {"scene": scene, "camera": CAMERA}
    more = [None] if argument == "support" else []
    for value in [*wrong(argument), *more]:
        check(lambda value: render(**{**arguments, argument: value}), argument, value)


def test_an_unknown_option_is_named_with_those_there_are(scene, tmp_path):
    """One class defines the options of three functions, also for type checkers."""
    names = [field.name for field in fields(RenderOptions)]
    assert sorted(RenderKeywords.__annotations__) == sorted(names)
    for call in (partial(render, scene, CAMERA), partial(render_to, tmp_path / "p.png", scene, CAMERA)):
        with pytest.raises(TypeError, match=r"^unknown option sample: known are samples, error, seed, .*pose$"):
            call(sample=4)
    with pytest.raises(TypeError, match=r"^unknown option pose: known are samples, .*executor$"):
        render_set("reference", tmp_path, [CAMERA], poses=[None], pose=None)
    with pytest.raises(ValueError, match="seed is -1"):
        render_set("reference", tmp_path, [CAMERA], poses=[None], seed=-1)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("value", ["text", [], Odd(), {}, np.zeros(3)])
def test_error_of_adaptive_samples(scene, value):
    check(lambda value: render(scene, CAMERA, samples=(4, 16), error=value), "error", value)


@pytest.mark.parametrize("argument", ["picture", *RENDER, "support"])
def test_render_to(scene, argument, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = {"picture": "p.png", "scene": scene, "camera": CAMERA}
    more = (
        [{"depth": 7}, {"depth": b"d.exr"}, {7: "d.exr"}, {"depth": [None]}, [], ()] if argument == "support" else []
    )
    for value in [*wrong(argument), *more]:
        check(lambda value: render_to(**{**arguments, argument: value}), argument, value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("argument", ["scene", "locations", "directions", "pose"])
def test_trace(scene, argument):
    arguments = {"scene": scene, "locations": [0.0, 0.0, 0.0], "directions": [0.0, 0.0, 1.0]}
    for value in wrong(argument):
        if argument in ("locations", "directions") and isinstance(value, np.ndarray):
            continue  # three numbers are a place, and a direction of zero has a test of its own
        check(lambda value: trace(**{**arguments, argument: value}), argument, value)


def test_load_scene():
    for value in ODD:
        check(load_scene, "name", value)
