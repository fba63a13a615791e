"""docs/scenes.md against the models: every key with its default, every example."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import TypeAdapter
from pydantic_core import PydanticUndefined

from ii_core.base.files import write_image
from raytrace_ii import load_scene, trace
from raytrace_ii.files.toml_schema import (  # fmt: skip
    LIGHTS,
    SHAPE_PARTS,
    SHAPES,
    TEXTURES,
    AnimationTable,
    BackgroundTable,
    FogTable,
    MaterialTable,
    MeshFile,
    ObjectTable,
    SceneFile,
    TrackTable,
)

DOCS = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
MODELS = {
    "scene": SceneFile,
    "background": BackgroundTable,
    "fog": FogTable,
    "material": MaterialTable,
    "object": ObjectTable,
    "mesh": MeshFile,
    "animation": AnimationTable,
    "track": TrackTable,
    **{
        f"{table} {name}": model
        for table, models in (("light", LIGHTS), ("texture", TEXTURES), ("shape", SHAPES), ("parts", SHAPE_PARTS))
        for name, model in models.items()
    },
}


TAGS = {"light": "kind", "texture": "kind", "shape": "shape", "parts": "part"}
KEY = r"(?P<bold>\*\*)?`(?P<key>\w+)(?: = (?P<value>[^`]+))?`(?:\*\*)?(?: = \*(?P<words>[^*]+)\*)?"
ITEM = re.compile(rf"^- (?P<keys>{re.sub('P<.*?>', ':', KEY)}(?:, {re.sub('P<.*?>', ':', KEY)})*)"
                  r"(?: \(\*(?P<kinds>[\w, ]+)\*\))?:", re.M)  # fmt: skip


def sections(text):
    """Return the keys with their defaults of each table, of each kind that its heading lists.

    Defaults are ``...`` for needed keys, None for absent ones, else as on the page, ``*in words*`` too.
    """
    found = {}
    for head, body in re.findall(r"^### (`[^\n]+`)\n(.*?)(?=^##|\Z)", text, re.M | re.S):
        table, *kinds = re.findall(r"`(\w+)`", head)
        for kind in kinds or [""]:
            keys = found[f"{table} {kind}".strip()] = [(TAGS[table], ...)] if kind else []
            for item in ITEM.finditer(body):
                of = (item["kinds"] or "").split(", ")
                assert of == [""] or set(of) < set(kinds), f"{head}: kinds {of}"
                if of == [""] or kind in of:
                    for one in re.finditer(KEY, item["keys"]):
                        words = one["words"] and f"*{one['words']}*"
                        keys.append((one["key"], ... if one["bold"] else one["value"] or words))
    return found


SECTIONS = sections(DOCS)


BALL = """
[material.any]
[[object]]
shape = "sphere"
radius_mm = 5
position_mm = [0, 0, 40]
material = "any"
"""


def test_every_table_of_a_file_has_its_section():
    assert set(SECTIONS) == set(MODELS)


@pytest.mark.parametrize("name", MODELS)
def test_every_key_is_documented_with_its_default_and_no_other(name):
    fields = MODELS[name].model_fields
    documented = dict(SECTIONS[name])
    assert len(documented) == len(SECTIONS[name]), "a key twice"
    assert set(documented) == set(fields)
    for key, said in documented.items():
        field = fields[key]
        if field.default is PydanticUndefined:
            assert said is ..., key
        elif field.default is None:
            assert said is None, key
        elif said == "*black*":
            assert field.default == BackgroundTable(horizon="#000000"), key
        elif said.startswith("*linear"):
            numbers = [float(n) for n in re.findall(r"[\d.]+", said)]
            np.testing.assert_allclose(np.ravel(field.default), np.resize(numbers, np.size(field.default)))
        else:
            value = tomllib.loads(f"x = {said}")["x"]
            reads = [m.func for m in field.metadata if hasattr(m, "func")] or [
                TypeAdapter(field.annotation).validate_python
            ]
            assert reads[0](value) == field.default, key


@pytest.fixture
def folder(tmp_path):
    """The files that the examples name."""
    write_image(tmp_path / "sky.exr", np.full((4, 8, 3), 0.5, np.float32))
    write_image(tmp_path / "leaves.png", np.full((4, 4, 4), 255, np.uint8))
    write_image(tmp_path / "leaves_normal.png", np.full((4, 4, 3), (128, 128, 255), np.uint8))
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "shelf.glb")
    return tmp_path


@pytest.mark.parametrize("text", re.findall(r"```toml\n(.*?)```", DOCS, re.S))
def test_every_toml_example_loads_and_can_be_traced(text, folder):
    if "[[object]]" not in text:
        text += BALL
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    scene = load_scene(folder / "scene.toml")
    seen = trace(scene, np.zeros((9, 3)), [(x, 0, 40) for x in range(-4, 5)])
    assert np.isfinite(seen.radiance).all() and (seen.object_id >= 0).any()


def test_the_python_example_runs():
    (text,) = re.findall(r"```python\n(.*?)```", DOCS, re.S)
    names = {}
    exec(text, names)
    assert names["shot"].picture.pixels.std() > 5 and names["same"].max_depth == 2
    floor = trace(names["scene"], [(0, 0, 60)], [(0, -1, 0)])
    assert floor.normal[0].tolist() == [0, 1, 0], "the sheet faces up"
