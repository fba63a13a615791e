"""Damaged glTF files: one line that names the file and the part; no traceback, no wrong picture."""

import json
import struct
import warnings
import zlib
from copy import deepcopy
from urllib.parse import unquote

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core.base.files import write_image
from raytrace_ii import load_scene
from raytrace_ii.files import beside
from raytrace_ii.files.load import read_model
from tests.support.gltf_files import SQUARE, SQUARE_FACES, SQUARE_UV, Gltf, glb


def good():
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), 128), wrapS=10497)
    material = gltf.material(pbr={"baseColorTexture": {"index": picture}})
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=material, TEXCOORD_0=SQUARE_UV))
    gltf.node(extensions=gltf.light(type="point"))
    return gltf


def set_at(tables, path, value):
    """Replace the value at a path of keys and rows; None removes it."""
    *way, last = path.split(".")
    for step in way:
        tables = tables[int(step) if isinstance(tables, list) else step]
    last = int(last) if isinstance(tables, list) else last
    if value is None:
        del tables[last]
    else:
        tables[last] = value


# Views and accessors of `good`: 0 the image; 1, 2, 3 POSITION, TEXCOORD_0, indices; accessors 0, 1, 2.
WRONG = [
    ("scene", 3, "scene: scenes.3 is named, there are 1"),
    ("scenes.0.nodes", [7], "scenes.0: nodes.7 is named, there are 2"),
    ("scenes.0.nodes", [0, 0], "scenes.0: nodes.0 is named twice: each node has one parent"),
    ("nodes.0.children", [0], "nodes.0: nodes.0 is named twice: each node has one parent"),
    ("nodes.0.mesh", 2, "nodes.0: meshes.2 is named, there are 1"),
    ("nodes.0.mesh", -1, "nodes.0.mesh: -1: a number of at least 0 is needed"),
    ("nodes.0.matrix", [1.0] * 15, "nodes.0.matrix: "),
    ("nodes.0.rotation", [0, 0, 0, 0], "nodes.0.rotation: a quaternion of length 0"),
    ("nodes.0.translation", [0, "far", 0], "nodes.0.translation.1: 'far': a number is needed"),
    ("nodes.1.extensions.KHR_lights_punctual.light", 4, "nodes.1: light 4 is named, there are 1"),
    ("extensions.KHR_lights_punctual.lights.0.type", "lamp", "extensions.KHR_lights_punctual.lights.0.type: unknown"),
    (
        "extensions.KHR_lights_punctual.lights.0.intensity",
        -1,
        "extensions.KHR_lights_punctual.lights.0.intensity: -1",
    ),
    ("meshes.0.primitives", None, "meshes.0.primitives: is missing"),
    ("meshes.0.primitives.0.mode", 9, "meshes.0.primitives.0.mode: 9: a number of at most 6 is needed"),
    ("meshes.0.primitives.0.material", 5, "meshes.0.primitives.0: materials.5 is named, there are 1"),
    ("meshes.0.primitives.0.indices", 8, "meshes.0.primitives.0.indices: accessors.8 is named, there are 3"),
    ("meshes.0.primitives.0.indices", 0, "meshes.0.primitives.0.indices: unsigned whole numbers are needed"),
    ("meshes.0.primitives.0.attributes.POSITION", None, "meshes.0.primitives.0: has no POSITION"),
    (
        "meshes.0.primitives.0.attributes.POSITION",
        1,
        "meshes.0.primitives.0.POSITION: has 2 components: 3 are needed",
    ),
    ("meshes.0.primitives.0.attributes.TEXCOORD_0", None, "materials.0 needs TEXCOORD_0, there is none"),
    ("accessors.1.count", 3, "meshes.0.primitives.0.TEXCOORD_0: has 3 rows, POSITION 4"),
    ("accessors.2.count", 5, "meshes.0.primitives.0: 5 corners: a multiple of 3 is needed"),
    ("accessors.2.count", 2, "meshes.0.primitives.0: 2 corners make no triangle"),
    ("accessors.0.count", 3, "meshes.0.primitives.0.indices: vertex 3 is named, there are 3"),
    ("accessors.0.count", 5, "accessors.0: bytes up to 60 of bufferViews.1 are named, there are 48"),
    ("accessors.0.count", 0, "accessors.0.count: 0: a number of at least 1 is needed"),
    ("accessors.0.byteOffset", 4, "accessors.0: bytes up to 52 of bufferViews.1 are named, there are 48"),
    ("accessors.0.type", "VEC9", "accessors.0: unknown type 'VEC9': known are SCALAR, VEC2, VEC3, VEC4"),
    ("accessors.0.componentType", 1, "accessors.0: unknown componentType 1: known are 5120"),
    ("accessors.0.bufferView", 9, "accessors.0: bufferViews.9 is named, there are 4"),
    ("bufferViews.1.buffer", 2, "bufferViews.1: buffers.2 is named, there are 1"),
    ("bufferViews.1.byteStride", 4, "bufferViews.1: byteStride 4 is less than a row, 12"),
    ("bufferViews.3.byteLength", 99999, "of buffers.0 are named, there are"),
    ("buffers.0.uri", None, "buffers.0: neither a uri nor a binary chunk of the file holds it"),
    ("buffers.0.uri", "no.bin", "no.bin does not exist"),
    ("buffers.0.uri", "http://example.org/a.bin", "buffers.0: uri 'http://example.org/a.bin': data or the relative"),
    (
        "buffers.0.uri",
        "/etc/hostname",
        "buffers.0: uri '/etc/hostname': the relative name of a file is needed",
    ),
    ("buffers.0.uri", "file:///etc/hostname", "buffers.0: uri 'file:///etc/hostname': data or the relative name"),
    ("buffers.0.uri", "data:;base64,AAA", "buffers.0: data uri: Incorrect padding"),
    ("buffers.0.byteLength", 99999, "buffers.0: 99999 bytes are needed, there are"),
    ("textures.0.source", 3, "materials.0: images.3 is named, there are 1"),
    ("textures.0.sampler", 3, "materials.0: samplers.3 is named, there are 1"),
    ("materials.0.pbrMetallicRoughness.baseColorTexture.index", 9, "materials.0: textures.9 is named, there are 1"),
    ("materials.0.pbrMetallicRoughness.metallicFactor", 2, "metallicFactor: 2: a number of at most 1 is needed"),
    ("materials.0.alphaMode", "HALF", "materials.0.alphaMode: unknown 'HALF': known are OPAQUE, MASK or BLEND"),
    ("images.0.bufferView", 1, "images.0: cannot be read as a picture"),
    ("images.0.bufferView", None, "images.0: neither a uri nor a bufferView is given"),
    ("asset", {"version": "1.0"}, "asset.version '1.0': glTF 2.0 is needed"),
    ("asset", None, "asset.version '': glTF 2.0 is needed"),
    (
        "extensionsRequired",
        ["KHR_draco_mesh_compression"],
        "extensionsRequired: KHR_draco_mesh_compression: convert the file with `gltf-transform copy in.glb ",
    ),
    (
        "extensionsRequired",
        ["KHR_texture_basisu", "EXT_meshopt_compression"],
        "`gltf-transform copy in.glb out.glb`, then `gltf-transform ktxdecompress in.glb out.glb` (npm package",
    ),
    ("extensionsRequired", ["EXT_other"], "extensionsRequired: EXT_other: known are KHR_"),
    (
        "images.0",
        {"uri": "data:;base64,q0tUWA=="},
        "images.0: a KTX2 image: PNG or JPEG is needed, convert the file with `gltf-transform ktxdecompress",
    ),
    ("nodes", {}, "nodes: {}: a list is needed"),
    ("meshes.0.primitives.0.attributes", [], "meshes.0.primitives.0.attributes: []: a table of keys is needed"),
    ("scenes.0.nodes", [1], "holds no triangles"),
]


@pytest.mark.parametrize(("path", "value", "says"), WRONG)
def test_faults_are_named_with_their_place(path, value, says, tmp_path):
    file = good().save(tmp_path / "m.gltf")
    tables = json.loads(file.read_text())
    tables["extensionsRequired"] = []
    set_at(tables, path, value)
    file.write_text(json.dumps(tables))
    with pytest.raises((ValueError, OSError)) as caught:
        load_scene(file)
    message = str(caught.value)
    assert message.startswith("m.gltf: ") and says in message and "\n" not in message, message


def test_values_that_draco_alone_holds_are_named(tmp_path):
    """A file that uses Draco and does not say that it is required: a box of glTF-Transform's had no area."""
    file = good().save(tmp_path / "m.gltf")
    tables = json.loads(file.read_text())
    del tables["accessors"][0]["bufferView"]
    file.write_text(json.dumps({**tables, "extensionsUsed": ["KHR_draco_mesh_compression"]}))
    with pytest.raises(ValueError, match=r"accessors.0: its values are compressed by Draco alone"):
        load_scene(file)


def test_values_that_are_not_finite_are_refused(tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(np.array(SQUARE) * [np.nan, 1, 1], SQUARE_FACES))
    with pytest.raises(ValueError, match=r"m\.glb: accessors\.0: holds values that are not finite numbers"):
        read_model(gltf.save(tmp_path / "m.glb"))


@pytest.mark.parametrize("count", [3 * 10**8, 10**15, 10**400])
def test_accessor_rows_without_data_are_bounded(count, tmp_path):
    """3·10⁸ rows of zeros took 6.9 GB; an earlier version tested only 10¹⁵, for which no machine has memory."""
    gltf = good()
    del gltf.json["accessors"][0]["bufferView"]  # all zero, then, however many
    gltf.json["accessors"][0]["count"] = count
    with pytest.raises(ValueError, match=r"m\.glb: accessors\.0: \d+ rows of zeros: at most 10000000 are made up"):
        read_model(gltf.save(tmp_path / "m.glb"))


@pytest.mark.slow
def test_instances_are_counted_before_they_are_made(tmp_path):
    """A small file may contain very many instances of a large mesh."""
    gltf = Gltf()
    gltf.mesh(np.tile(SQUARE, (5000, 1)), np.arange(20000 * 3) % 20000)
    for _ in range(3000):
        gltf.node(mesh=0)
    with pytest.raises(ValueError, match=r"m\.glb: nodes\.\d+: more than 50000000 triangles"):
        read_model(gltf.save(tmp_path / "m.glb"))


@pytest.mark.parametrize(
    "uri", ["no.png", "../secret.png", "%2e%2e/secret.png", "/etc/hostname", "http://a.org/b.png"]
)
def test_an_unavailable_image_is_named_and_left_out(uri, tmp_path):
    """No file outside the scene's folder is read, by ``..``, percent signs or a link."""
    write_image(tmp_path / "secret.png", np.zeros((2, 2, 3), np.uint8))
    (tmp_path / "in").mkdir()
    gltf = good()
    gltf.json["images"][0] = {"uri": uri}
    (part,) = read_model(gltf.save(tmp_path / "in" / "m.glb")).parts
    assert part.material.texture is None
    (note,) = read_model(tmp_path / "in" / "m.glb").left_out
    assert note.startswith("images.0 (") and unquote(uri) in note
    (tmp_path / "in" / "link.png").symlink_to(tmp_path / "secret.png")
    gltf.json["images"][0] = {"uri": "link.png"}
    assert "leads out of the file's folder" in read_model(gltf.save(tmp_path / "in" / "m.glb")).left_out[0]


def test_a_buffer_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.bin").write_bytes(bytes(good().blob))
    file = good().save(tmp_path / "in" / "m.gltf", uri="../secret.bin")
    with pytest.raises(ValueError, match=r"buffers\.0: uri '\.\./secret\.bin' leads out of the file's folder"):
        read_model(file)


def test_a_texture_of_forged_size_is_refused_by_its_header(tmp_path, monkeypatch):
    """A PNG of a few bytes that states 40000² pixels: nothing is decoded, no memory is taken."""
    header = struct.pack(">IIBBBBB", 40000, 40000, 8, 2, 0, 0, 0)
    chunk = b"IHDR" + header
    data = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    (tmp_path / "big.png").write_bytes(data + struct.pack(">I", 0) + b"IDAT" + struct.pack(">I", zlib.crc32(b"IDAT")))
    gltf = good()
    gltf.json["images"][0] = {"uri": "big.png"}
    with pytest.raises(ValueError, match=r"m\.glb: images\.0: .*header claims a 4577 MB image"):
        read_model(gltf.save(tmp_path / "m.glb"))  # OpenImageIO checks only PNG itself
    monkeypatch.setattr(beside, "MOST_TEXELS", 3)
    with pytest.raises(ValueError, match=r"m\.glb: images\.0: it has 2×2 pixels: at most 3 are read"):
        read_model(good().save(tmp_path / "m.glb"))


def test_factors_rounded_past_their_bounds_are_clamped(tmp_path):
    """Writers in float32 produce 1.0000001; larger excess is an error, as before."""
    gltf = good()
    pbr = gltf.json["materials"][0]["pbrMetallicRoughness"]
    pbr |= {"metallicFactor": 1 + 1e-5, "roughnessFactor": -1e-5, "baseColorFactor": [1.000001, 1, 1, 1.00001]}
    (part,) = read_model(gltf.save(tmp_path / "m.glb")).parts
    exact = good()
    exact.json["materials"][0]["pbrMetallicRoughness"] |= {"metallicFactor": 1, "roughnessFactor": 0}
    (expected,) = read_model(exact.save(tmp_path / "exact.glb")).parts
    for what in ("mirror", "colour", "transmission", "specular", "shininess"):
        assert getattr(part.material, what) == getattr(expected.material, what)
    pbr["metallicFactor"] = 1 + 2e-5
    with pytest.raises(ValueError, match=r"metallicFactor: 1\.00002: a number of at most 1 is needed"):
        read_model(gltf.save(tmp_path / "m.glb"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d[:10], "GLB header: 20 bytes are needed, there are 10"),
        (lambda d: d[:-5], "bytes are announced, there are"),
        (lambda d: d[:4] + struct.pack("<I", 1) + d[8:], "GLB header: version 1: version 2 is needed"),
        (
            lambda d: d[:12] + struct.pack("<I", 10**9) + d[16:],
            "GLB chunk at byte 12: 1000000000 bytes are announced",
        ),
        (lambda d: d[:16] + b"ABCD" + d[20:], "GLB has no JSON chunk"),
        (lambda d: d[:20] + b"]" + d[21:], "JSON: "),
        (lambda d: b"PK" + d[2:], "JSON: "),
        (lambda d: b"", "JSON: "),
        (lambda d: b"[]", "asset.version '': glTF 2.0 is needed"),
        (lambda d: b"[" * 100000, "JSON: "),
        (lambda d: glb({"asset": {"version": "2.0"}, "extras": 1}, b""), "holds no triangles"),
    ],
)
def test_damaged_containers(change, says, tmp_path):
    file = good().save(tmp_path / "m.glb")
    file.write_bytes(change(file.read_bytes()))
    with pytest.raises(ValueError) as caught:
        read_model(file)
    assert str(caught.value).startswith("m.glb: ") and says in str(caught.value), str(caught.value)


@given(st.data())
def test_a_file_cut_off_or_with_a_wrong_byte_is_read_or_refused_in_words(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("cut")
    whole = bytearray(good().save(folder / "m.glb").read_bytes())
    for _ in range(data.draw(st.integers(0, 3))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    (folder / "m.glb").write_bytes(
        whole[: data.draw(st.integers(0, len(whole)))] if data.draw(st.booleans()) else whole
    )
    try:
        read_model(folder / "m.glb")
    except (ValueError, OSError) as error:
        assert str(error).startswith("m.glb: ") and "\n" not in str(error), str(error)


def rich():
    """Return a file with every table."""
    gltf = good()
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 0.5},
        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [0.1, 0.2, 0.3]},
        "KHR_materials_ior": {"ior": 1.4},
        "KHR_materials_dispersion": {"dispersion": 0.2},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 1, 1]},
    }
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 1}}}
    pbr = {"baseColorFactor": [0.5, 0.5, 0.5, 0.5], "metallicFactor": 0.5, "baseColorTexture": moved}
    index = gltf.material(
        extensions, pbr=pbr, normalTexture={"index": 0, "scale": 1}, alphaMode="MASK", alphaCutoff=0.3,
        emissiveFactor=[1, 1, 1], emissiveTexture={"index": 0},
    )  # fmt: skip
    mesh = gltf.mesh(SQUARE, SQUARE_FACES, material=index, TEXCOORD_0=SQUARE_UV)
    gltf.node(mesh=mesh, rotation=[0, 0, 0, 1], scale=[1, 1, 1])
    spot = gltf.light(type="spot", spot={"innerConeAngle": 0.1, "outerConeAngle": 0.2})
    gltf.node(extensions=spot, matrix=np.eye(4).reshape(-1).tolist())
    return gltf


def places(tables, way=()):
    """Return the path of every key and row of a file."""
    rows = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    for key, value in rows:
        yield (*way, key)
        yield from places(value, (*way, key))


STRANGE = [
    None, True, 0, 1, -1, 3, 10**12, 10**30, 10**400, 1e308, -1e300, 0.5, "5", [], {}, [1], [1, 2, 3], [None],
    {"a": 1}, 5125,
]  # fmt: skip


@pytest.mark.slow
@settings(max_examples=300)
@given(st.data())
def test_a_file_with_strange_values_is_read_or_refused_in_words(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "strange"
    folder.mkdir(exist_ok=True)
    file = rich().save(folder / "m.gltf")
    tables = json.loads(file.read_text())
    for _ in range(data.draw(st.integers(1, 3))):
        *way, last = data.draw(st.sampled_from(list(places(tables))))
        at = tables
        for step in way:
            at = at[step]
        at[last] = deepcopy(data.draw(st.sampled_from(STRANGE)))  # the next step may change it in turn
    file.write_text(json.dumps(tables))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            load_scene(file)
    except (ValueError, OSError) as error:
        assert str(error).startswith("m.gltf: ") and "\n" not in str(error), str(error)


def test_the_command_says_which_object_of_which_scene(run, refused, tmp_path):
    (tmp_path / "m.glb").write_bytes(good().save(tmp_path / "m.glb").read_bytes()[:300])
    (tmp_path / "s.toml").write_text('[[object]]\nname = "cow"\nmesh = "m.glb"\n')
    result = run("render", tmp_path / "s.toml", "-o", tmp_path / "a.png")
    refused(result, f"{tmp_path}/s.toml: object.0 (cow): m.glb: GLB header: ")
