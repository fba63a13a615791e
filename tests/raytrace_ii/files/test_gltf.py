"""glTF files: geometry, nodes, textures, lights and warnings."""

import warnings

import numpy as np
import pytest
import trimesh

from raytrace_ii import load_scene, trace
from raytrace_ii.files.load import read_model
from tests.support.gltf_files import SQUARE, SQUARE_FACES, SQUARE_UV, Gltf, png

AHEAD = (0.0, 0.0, 1.0)
# Corner 0 at the origin, edges of 1, 2, 3 along +x, +y and +z of the file; outward faces.
WEDGE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.0]])
WEDGE_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def scene_of(tmp_path, gltf, text="", name="model.glb", head="ambient = 1"):
    gltf.save(tmp_path / name)
    path = tmp_path / "scene.toml"
    path.write_text(f'{head}\n[[object]]\nname = "o"\nmesh = "{name}"\n{text}\n')
    return load_scene(path)


def seen(scene, x, y, z=-50.0):
    """Radiance straight ahead from (x, y)."""
    return trace(scene, [(x, y, z)], [AHEAD]).radiance[0]


def volume(vertices, faces):
    p = vertices[faces]
    return np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6


# Geometry and nodes


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_file_has_the_geometry_that_trimesh_finds_in_it(suffix, tmp_path):
    """trimesh, an independent reader and writer, has written the file."""
    ball = trimesh.creation.icosphere(2)
    other = trimesh.Scene()
    rng = np.random.default_rng(1)
    for _ in range(3):
        matrix = np.eye(4)
        matrix[:3] = rng.normal(size=(3, 4))
        other.add_geometry(ball.copy(), transform=matrix)
    if suffix == ".glb":
        (tmp_path / "m.glb").write_bytes(other.export(file_type="glb"))
    else:
        for name, data in other.export(file_type="gltf").items():
            (tmp_path / name.replace("model", "m")).write_bytes(data)
    parts = read_model(tmp_path / f"m{suffix}").parts
    theirs = trimesh.load(tmp_path / f"m{suffix}", process=False)
    assert {part.name for part in parts} == set(theirs.graph.nodes_geometry) and len(parts) == 3
    for part in parts:
        matrix, geometry = theirs.graph[part.name]
        mesh = theirs.geometry[geometry]
        expected = trimesh.transform_points(mesh.vertices[mesh.faces].mean(axis=1), matrix) * [1, 1, -1]
        np.testing.assert_allclose(part.mesh.vertices[part.mesh.faces].mean(axis=1), expected, atol=1e-6)
        assert volume(part.mesh.vertices, part.mesh.faces) > 0


def test_node_transforms_by_hand(tmp_path):
    """A quarter turn about z, doubled, moved: x of the wedge goes up, its z towards the viewer."""
    gltf = Gltf()
    wedge = gltf.mesh(WEDGE, WEDGE_FACES)
    child = gltf.node(root=False, mesh=wedge, name="wedge", scale=[2, 2, 2], rotation=[0, 0, 0.5**0.5, 0.5**0.5])
    gltf.node(children=[child], translation=[10, 20, 30])
    (part,) = read_model(gltf.save(tmp_path / "m.glb")).parts
    assert part.name == "wedge"
    # (x, y, z) → (−2y, 2x, 2z) + (10, 20, 30), then z → −z
    np.testing.assert_allclose(
        part.mesh.vertices, [[10, 20, -30], [10, 22, -30], [6, 20, -30], [10, 20, -36]], atol=1e-6
    )
    assert volume(part.mesh.vertices, part.mesh.faces) == pytest.approx(8.0)  # 1·2·3/6 · 2³


def test_a_matrix_that_mirrors_keeps_faces_and_normals_outward(tmp_path):
    ball = trimesh.creation.icosphere(2)
    gltf = Gltf()
    mesh = gltf.mesh(ball.vertices, ball.faces, NORMAL=ball.vertices.astype(np.float32))
    for i, scale in enumerate([(1, 2, 3), (-1, 2, 3), (-1, -2, -3)]):
        gltf.node(mesh=mesh, matrix=np.diag([*scale, 1.0]).reshape(-1).tolist(), name=f"ball {i}")
    for part in read_model(gltf.save(tmp_path / "m.glb")).parts:
        m = part.mesh
        assert volume(m.vertices, m.faces) == pytest.approx(6 * ball.volume, rel=1e-5)
        gradient = m.vertices / np.square([1, 2, 3])  # of the ellipsoid
        gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
        np.testing.assert_allclose(m.normals, gradient, atol=1e-5)


def test_instances_share_their_arrays(tmp_path):
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), 128))
    material = gltf.material(pbr={"baseColorTexture": {"index": picture}})
    mesh = gltf.mesh(SQUARE, SQUARE_FACES, material=material, TEXCOORD_0=SQUARE_UV)
    for i in range(3):
        gltf.node(mesh=mesh, name=f"square {i}", translation=[3 * i, 0, 0])
    scene = scene_of(tmp_path, gltf)
    assert [body.name for body in scene.bodies] == ["o/square 0", "o/square 1", "o/square 2"]
    first, *others = scene.bodies
    for other in others:
        assert np.shares_memory(first.faces, other.faces)
        assert first.texture_coordinates is other.texture_coordinates
        assert first.material.texture is other.material.texture
    parts = read_model(tmp_path / "model.glb").parts
    assert parts[0].mesh.uv is parts[1].mesh.uv and parts[0].material is parts[2].material
    assert np.shares_memory(parts[0].mesh.faces, parts[1].mesh.faces)


@pytest.mark.parametrize(
    ("mode", "indices", "triangles"),
    [
        (4, [0, 1, 2, 0, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (5, [0, 1, 3, 2], [[0, 1, 3], [3, 1, 2]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (4, None, [[0, 1, 2]]),
    ],
)
def test_triangles_strips_and_fans(mode, indices, triangles, tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE if indices else SQUARE[:3], indices, mode=mode))
    (part,) = read_model(gltf.save(tmp_path / "m.glb")).parts
    faces = part.mesh.faces[:, ::-1]  # turned round as z is
    assert [sorted(f) for f in faces.tolist()] == [sorted(f) for f in triangles]
    p = (part.mesh.vertices * [1, 1, -1])[faces]
    assert (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] > 0).all(), "all face the viewer"


def test_points_and_lines_are_named(tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES))
    gltf.node(mesh=gltf.mesh(SQUARE, mode=0))
    model = read_model(gltf.save(tmp_path / "m.glb"))
    assert len(model.parts) == 1 and model.left_out == ["points and lines"]


def test_integers_strides_and_sparse_values(tmp_path):
    """Positions as normalised 16-bit integers between other bytes, two of them replaced."""
    gltf = Gltf()
    values = np.zeros((4, 4), np.int16)
    values[:, :3] = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 32767
    place = gltf.add(
        "accessors",
        {
            "bufferView": gltf.view(values.tobytes(), byteStride=8),
            "componentType": 5122, "normalized": True, "type": "VEC3", "count": 4,
            "sparse": {
                "count": 1,
                "indices": {"bufferView": gltf.view(np.array([2], np.uint16).tobytes()), "componentType": 5123},
                "values": {"bufferView": gltf.view(np.array([0, 0, 32767], np.int16).tobytes())},
            },
        },
    )  # fmt: skip
    gltf.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": place}, "indices": gltf.accessor(
        np.array([0, 1, 2, 0, 2, 3], np.uint8))}]}]  # fmt: skip
    gltf.json["extensionsRequired"] = gltf.json["extensionsUsed"] = ["KHR_mesh_quantization"]
    gltf.node(mesh=0)
    (part,) = read_model(gltf.save(tmp_path / "m.glb")).parts
    np.testing.assert_allclose(part.mesh.vertices, [[-1, -1, 0], [1, -1, 0], [0, 0, -1], [-1, 1, 0]], atol=1e-6)


def test_flat_where_the_file_has_no_normals(tmp_path):
    """As glTF 2.0 says, §3.7.2.1."""
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(WEDGE, WEDGE_FACES))
    assert read_model(gltf.save(tmp_path / "m.glb")).parts[0].mesh.normals is None


# Textures

CORNERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)  # red on top left


def painted(gltf, picture, *, uv=SQUARE_UV, info=None, name="TEXCOORD_0", **material):
    pbr = {"baseColorTexture": {"index": picture, **(info or {})}, "metallicFactor": 0}
    extensions = {"KHR_materials_specular": {"specularFactor": 0}}
    index = gltf.material(extensions, pbr=pbr, **material)
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=index, **{name: np.asarray(uv, np.float32)}))


def quarters(scene):
    """Colours at the middles of the square's quarters: top left, top right, bottom left, bottom right."""
    return [tuple(seen(scene, x, y).round(3)) for y in (0.5, -0.5) for x in (-0.5, 0.5)]


R, G, B, W = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)


def test_an_image_lies_as_in_the_file(tmp_path):
    gltf = Gltf()
    painted(gltf, gltf.texture(CORNERS))
    assert quarters(scene_of(tmp_path, gltf)) == [R, G, B, W]


def test_images_in_files_beside_and_in_data_uris(tmp_path):
    import base64

    (tmp_path / "pic tures").mkdir()
    (tmp_path / "pic tures" / "ü.png").write_bytes(png(CORNERS))
    data = "data:image/png;base64," + base64.b64encode(png(CORNERS)).decode()
    for uri in ("pic%20tures/%C3%BC.png", "pic tures/ü.png", data):
        gltf = Gltf()
        painted(gltf, gltf.texture(None, uri=uri))
        assert quarters(scene_of(tmp_path, gltf, name="model.gltf")) == [R, G, B, W]


def test_buffers_in_files_beside_and_below(tmp_path):
    gltf = Gltf()
    painted(gltf, gltf.texture(CORNERS))
    (tmp_path / "my data").mkdir()
    (tmp_path / "my data" / "all data.bin").write_bytes(bytes(gltf.blob))
    gltf.save(tmp_path / "m.gltf", uri="./my%20data/all%20data.bin")
    assert len(read_model(tmp_path / "m.gltf").parts) == 1


def test_cut_outs_are_holes(tmp_path):
    pixels = np.full((8, 8, 4), 255)
    pixels[:4, :, 3] = 0  # the upper half
    gltf = Gltf()
    painted(gltf, gltf.texture(pixels), alphaMode="MASK")
    scene = scene_of(tmp_path, gltf)
    there = trace(scene, [(0, 0.5, -5), (0, -0.5, -5)], [AHEAD, AHEAD]).object_id
    assert there.tolist() == [-1, 0]


@pytest.mark.parametrize("turn", [0, 90])
def test_directions_of_a_normal_map(turn, tmp_path):
    """Red is along growing u, green up the image: 45° to the right, or upwards, is brightest lit from there."""
    gltf = Gltf()
    lean = (255 - 37, 128, 255 - 37) if turn == 0 else (128, 255 - 37, 255 - 37)
    bumps = gltf.texture(np.full((4, 4, 3), lean))
    extensions = {"KHR_materials_specular": {"specularFactor": 0}}
    pbr = {"metallicFactor": 0}
    index = gltf.material(extensions, pbr=pbr, normalTexture={"index": bumps})
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=index, TEXCOORD_0=SQUARE_UV))
    towards = {"right": (1, 0, -1), "left": (-1, 0, -1), "up": (0, 1, -1), "down": (0, -1, -1)}
    found = {}
    for name, (x, y, z) in towards.items():
        head = f'ambient = 0\n[[light]]\nkind = "directional"\ndirection = [{-x}, {-y}, {-z}]'
        found[name] = seen(scene_of(tmp_path, gltf, head=head), 0, 0)[0]
    bright, dark = ("right", "left") if turn == 0 else ("up", "down")
    # facing the light; at right angles to it; and halfway, cos 60°
    assert found.pop(bright) == pytest.approx(1, abs=0.01) and found.pop(dark) == pytest.approx(0, abs=0.01)
    assert list(found.values()) == pytest.approx([0.5, 0.5], abs=0.01)


def test_textures_use_their_set_of_coordinates(tmp_path):
    gltf = Gltf()
    flipped = SQUARE_UV[[1, 0, 3, 2]]
    painted(gltf, gltf.texture(CORNERS), uv=flipped, info={"texCoord": 1}, name="TEXCOORD_1")
    assert quarters(scene_of(tmp_path, gltf)) == [G, R, W, B]


def test_a_texture_transform(tmp_path):
    """A quarter turn as the extension has it: uv turn counter-clockwise about the upper left corner."""
    gltf = Gltf()
    move = {"rotation": np.pi / 2, "offset": [0, 1]}
    painted(gltf, gltf.texture(CORNERS), info={"extensions": {"KHR_texture_transform": move}})
    # u' = v, v' = 1 − u: what lies at the square's top left (0, 0) shows the image's bottom left (0, 1)
    assert quarters(scene_of(tmp_path, gltf)) == [B, R, W, G]
    gltf = Gltf()
    move = {"scale": [0.5, 0.5], "offset": [0.5, 0]}
    painted(gltf, gltf.texture(CORNERS), info={"extensions": {"KHR_texture_transform": move}})
    assert quarters(scene_of(tmp_path, gltf))[1] != R, "all of it shows the top right"
    np.testing.assert_allclose(seen(load_scene(tmp_path / "scene.toml"), 0, 0), G, atol=1e-3)


def test_images_wrap_as_the_sampler_states(tmp_path):
    """Coordinates run from −1 to 2: 3 × 3 tiles, of which each shows its four quarters.

    Earlier, mirrored images were repeated unmirrored; the older test of that name checked only the warning.
    """
    for wrap, tile in ((10497, (R, G, B, W)), (33648, (G, R, W, B)), (33071, (R, R, B, B))):
        gltf = Gltf()
        painted(gltf, gltf.texture(CORNERS, wrapS=wrap), uv=SQUARE_UV * 3 - 1)
        scene = scene_of(tmp_path, gltf)
        assert read_model(tmp_path / "model.glb").left_out == []
        for dx in (-1, 1):  # the tile to the left in the middle row; wrapT repeats
            for dy, row in ((1, tile[:2]), (-1, tile[2:])):
                there = seen(scene, -2 / 3 + dx / 6, dy / 6)
                np.testing.assert_allclose(there, row[(dx + 1) // 2], atol=1e-3)
    gltf = Gltf()
    painted(gltf, gltf.texture(CORNERS, wrapT=1))
    gltf.save(tmp_path / "m.glb")
    with pytest.raises(ValueError, match=r"samplers\.0: unknown wrapping 1: known are 10497, 33648, 33071"):
        read_model(tmp_path / "m.glb")


def test_vertex_colours_are_linear_and_multiplied_by_the_base_colour(tmp_path):
    gltf = Gltf()
    colours = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], np.float32)
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=gltf.matt((0.5, 0.5, 1.0)), COLOR_0=colours))
    scene = scene_of(tmp_path, gltf)
    np.testing.assert_allclose(seen(scene, -0.999, -0.999), [0.5, 0, 0], atol=2e-3)
    np.testing.assert_allclose(seen(scene, 0, -0.999), [0.25, 0.25, 0], atol=2e-3)
    normalised = (colours * 255).astype(np.uint8)
    again = Gltf()
    index = again.accessor(normalised, normalized=True)
    again.node(mesh=again.mesh(SQUARE, SQUARE_FACES, material=again.matt((0.5, 0.5, 1.0)), COLOR_0=index))
    scene = scene_of(tmp_path, again)
    np.testing.assert_allclose(seen(scene, 0, -0.999), [0.25, 0.25, 0], atol=2e-3)


def test_the_materials_key_of_an_object_overrides_the_files(tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=gltf.matt((1, 0, 0))), name="a")
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES), translation=[3, 0, 0], name="b")
    head = 'ambient = 1\n[material.green]\ncolour = "#00ff00"'
    scene = scene_of(tmp_path, gltf, 'material = "green"', head=head)
    assert [body.name for body in scene.bodies] == ["o/a", "o/b"]
    np.testing.assert_allclose(seen(scene, 0, 0), G)
    np.testing.assert_allclose(seen(scene_of(tmp_path, gltf), 0, 0), R)


# Lights


def look(place, ahead):
    """A node's matrix whose −z runs along ``ahead``."""
    back = -np.asarray(ahead, float) / np.linalg.norm(ahead)
    right = np.cross([0, 1, 0.01], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(back, right), back, place])
    return matrix.T.reshape(-1).tolist()


def test_lights_stand_where_the_file_puts_them_and_are_balanced_at_its_middle(tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES))  # its middle is the origin
    gltf.node(extensions=gltf.light(type="point", intensity=36, color=[1, 0.5, 0]), translation=[0, 0, 3])
    gltf.node(extensions=gltf.light(type="directional", intensity=2), matrix=look([9, 9, 9], [1, 0, 0]))
    cone = {"innerConeAngle": 0.1, "outerConeAngle": 0.2}
    gltf.node(extensions=gltf.light(type="spot", intensity=8, spot=cone), matrix=look([0, 2, 0], [0, -1, -1]))
    scene = scene_of(tmp_path, gltf, "scale = 10\nposition_mm = [1, 2, 30]")
    point, sun, spot = scene.lights
    assert (point.kind, sun.kind, spot.kind) == ("point", "directional", "spot")
    np.testing.assert_allclose(point.vector, [1, 2, 0])  # 3 towards the viewer, times 10
    np.testing.assert_allclose(np.array(sun.vector) / np.linalg.norm(sun.vector), [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(spot.vector, [1, 22, 30])
    ahead = np.array(spot.direction) / np.linalg.norm(spot.direction)
    np.testing.assert_allclose(ahead, [0, -(0.5**0.5), 0.5**0.5], atol=1e-9)
    np.testing.assert_allclose(spot.cone_deg, np.degrees([0.1, 0.2]))
    # 36 cd at 3, 2 lx, 8 cd at 2: 4, 2 and 2 lx, of which all together are 1
    np.testing.assert_allclose(point.colour, np.array([1, 0.5, 0]) / 2)
    np.testing.assert_allclose([sun.colour, spot.colour], np.full((2, 3), 0.25))
    twice = load_scene(_appended(tmp_path / "scene.toml", "lights = 2"))
    np.testing.assert_allclose(twice.lights[0].colour, [1, 0.5, 0])
    assert not load_scene(_appended(tmp_path / "scene.toml", "lights = 0", "lights = 2")).lights


def _appended(path, text, instead=""):
    path.write_text(path.read_text().replace(instead, "") + text + "\n")
    return path


# What is not supported


def test_everything_unsupported_is_named_in_one_warning(tmp_path):
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), 200))
    material = gltf.material(
        {"KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_sheen": {}},
        occlusionTexture={"index": picture},
        emissiveTexture={"index": picture},
        emissiveFactor=[1, 1, 1],
    )
    mesh = gltf.mesh(SQUARE, SQUARE_FACES, material=material, TEXCOORD_0=SQUARE_UV)
    gltf.json["meshes"][mesh]["primitives"][0]["targets"] = [{"POSITION": 0}]
    gltf.json["meshes"][mesh]["weights"] = [0.5]
    gltf.json |= {"animations": [{"channels": [], "samplers": []}], "skins": [{"joints": [0]}], "cameras": [{}]}
    gltf.json["extensionsUsed"] = ["KHR_materials_clearcoat", "KHR_materials_sheen", "EXT_own"]
    gltf.node(mesh=mesh, skin=0)
    gltf.node(mesh=mesh, translation=[0, 0, 1], extensions={"EXT_own": {}}, extras={"any": 1})
    with pytest.warns(UserWarning) as caught:
        scene_of(tmp_path, gltf, '[[object]]\nmesh = "model.glb"')  # twice the file, once the warning
    (warning,) = caught
    head, _, names = str(warning.message).partition(": not supported or not there, and left out: ")
    assert head == str(tmp_path / "model.glb")
    assert set(names.split(", ")) == {
        "cameras", "a skin over a mesh without joints", "EXT_own",
        "materials.occlusionTexture", "KHR_materials_clearcoat", "KHR_materials_sheen",
    }  # fmt: skip
    assert warning.filename == __file__


def test_a_file_of_only_what_is_supported_warns_of_nothing(tmp_path):
    gltf = Gltf()
    painted(gltf, gltf.texture(CORNERS, wrapS=10497, minFilter=9987, magFilter=9729), doubleSided=True)
    gltf.json["asset"] |= {"generator": "x", "copyright": "y"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene_of(tmp_path, gltf)


@pytest.mark.slow
def test_the_command_warns_in_one_line(run, tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES))
    gltf.json["cameras"] = [{}]
    gltf.save(tmp_path / "model.glb")
    code, _, err = run("render", tmp_path / "model.glb", "--scale", 64, "-o", tmp_path / "a.png")
    assert code == 0 and (tmp_path / "a.png").is_file()
    (line,) = [line for line in err.splitlines() if line.startswith("warning: ")]
    assert line.endswith("model.glb: not supported or not there, and left out: cameras")


# A file alone


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "stl"])
def test_a_mesh_file_alone_fills_the_working_volume(kind, tmp_path):
    mesh = trimesh.creation.box((4, 1, 2))
    mesh.apply_translation([100, 5, -7])
    mesh.export(tmp_path / f"brick.{kind}")
    scene = load_scene(tmp_path / f"brick.{kind}")
    assert scene.name == "brick" and len(scene.lights) == 2
    # 4×1×2 in 40×20×60: ten times as large, in the middle, its front at 20 mm
    np.testing.assert_allclose(scene.bounds_mm, [[-20, -5, 20], [20, 5, 40]], atol=1e-4)
    assert trace(scene, [(0, 0, 0)], [AHEAD]).radiance[0].min() > 0.05


def test_a_file_alone_keeps_its_own_lights(tmp_path):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES))
    gltf.node(extensions=gltf.light(type="point"), translation=[0, 1, 1])
    scene = load_scene(gltf.save(tmp_path / "m.glb"))
    (light,) = scene.lights  # a square of 2 becomes one of 20 mm at z = 20
    np.testing.assert_allclose(light.vector, [0, 10, 10])
    np.testing.assert_allclose(light.colour, 1)


def test_a_file_alone_is_rotated_before_it_is_fitted(tmp_path):
    trimesh.Trimesh(WEDGE, WEDGE_FACES, process=False).export(tmp_path / "wedge.ply")
    (body,) = load_scene(tmp_path / "wedge.ply", rotate_deg=(0, 0, 90)).bodies
    # x becomes y, y becomes −x, and the file's z lies along −z: 2×1×3 in 40×20×60, twenty times as large
    corners = [[20, -10, 80], [20, 10, 80], [-20, -10, 80], [20, -10, 20]]
    np.testing.assert_allclose(np.unique(body.vertices.round(3), axis=0), sorted(corners), atol=1e-4)


def test_a_part_of_a_file_fills_the_working_volume(tmp_path, run, refused):
    gltf = Gltf()
    square = gltf.mesh(SQUARE, SQUARE_FACES)
    gltf.node(mesh=square, name="ground", scale=[50, 50, 50])
    gltf.node(mesh=square, name="head", translation=[7, 0, 0])
    path = gltf.save(tmp_path / "m.glb")
    ground, head = load_scene(path, fit="he*d").bodies
    np.testing.assert_allclose([head.vertices.min(axis=0)[:2], head.vertices.max(axis=0)[:2]], [[-10, -10], [10, 10]])
    assert np.ptp(ground.vertices[:, 0]) == pytest.approx(1000)
    output = ("--scale", 64, "-o", tmp_path / "a.png")
    refused(run("render", path, "--fit", "tail", *output), "no part has such a name, known are ground, head")
    refused(run("render", path, "--rotate", "1,2", *output), "rotate is '1,2': three numbers x,y,z are needed")
    refused(run("render", "apples", "--rotate", "0,90,0", *output), "only a mesh file can be rotated and fitted")
    refused(run("render", "--set", "reference", "--fit", "head", *output[:2], "-o", tmp_path / "s"), "--fit")
