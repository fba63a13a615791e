"""Materials of OBJ, PLY and STL files."""

import numpy as np
import pytest
import trimesh

from ii_core.base.files import write_image
from raytrace_ii import load_scene, trace
from raytrace_ii.files.load import read_model
from raytrace_ii.scene.textures import VertexColours, linear

OBJ = """
mtllib a.mtl
o left
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl red one
f 1/1 2/2 3/3
usemtl glass
f 1/1 3/3 4/4
o right
usemtl glass
f 1/1 2/2 3/3
"""
MTL = """# two
newmtl red one
Kd 0.5 0.25 0
Ks 0.2 0.4 0.6
Ns 30
Ke 0 0 2
illum 2
newmtl glass
Ka 1 1 1
Kd 0 0 1
Tr 0.8
Tf 1 0.5 0.25
Ni 1.45
"""


def saved(tmp_path, obj=OBJ, mtl=MTL):
    (tmp_path / "a.obj").write_text(obj)
    (tmp_path / "a.mtl").write_text(mtl)
    return tmp_path / "a.obj"


def test_obj_and_mtl(tmp_path):
    model = read_model(saved(tmp_path))
    parts = {part.name: part for part in model.parts}
    assert list(parts) == ["left_red one", "left_glass", "right_glass"] and not model.left_out
    red = parts["left_red one"].material
    np.testing.assert_allclose(red.colour, linear([0.5, 0.25, 0]))
    np.testing.assert_allclose(red.specular, linear([0.2, 0.4, 0.6]).mean())
    np.testing.assert_allclose(red.emission, [0, 0, 2])
    assert red.shininess == 30 and not red.transmissive
    glass = parts["right_glass"].material
    assert glass is parts["left_glass"].material
    np.testing.assert_allclose(glass.transmission, 0.8 * linear([1, 0.5, 0.25]))
    assert glass.ior == 1.45 and glass.specular == 0


def test_opacity_either_way(tmp_path):
    for line in ("d 0.25", "Tr 0.75"):
        path = saved(tmp_path, OBJ, MTL.replace("Tr 0.8", line).replace("Tf 1 0.5 0.25\n", ""))
        assert read_model(path).parts[-1].material.transmission == (0.75,) * 3


def test_a_mirror_of_illum_3(tmp_path):
    red = read_model(saved(tmp_path, OBJ, MTL.replace("illum 2", "illum 3"))).parts[0].material
    np.testing.assert_allclose(red.mirror, linear([0.2, 0.4, 0.6]))


def test_map_kd_is_seen(tmp_path):
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = 255, 0, 0
    (tmp_path / "my maps").mkdir()
    write_image(tmp_path / "my maps" / "c.png", pixels)
    saved(tmp_path, OBJ.replace("usemtl glass", "usemtl red one"), "newmtl red one\nmap_Kd my maps\\c.png\n")
    (tmp_path / "s.toml").write_text('ambient = 1\n[[object]]\nmesh = "a.obj"\n')
    scene = load_scene(tmp_path / "s.toml")
    aims = np.array([[0.3, 0.75, -5], [1.5, 0.7, -5], [1.7, 0.25, -5]])
    seen = trace(scene, aims, np.broadcast_to([0.0, 0, 1], aims.shape)).radiance
    np.testing.assert_allclose(seen[1:], 0, atol=1e-6)
    assert seen[0, 0] > 0.5 and seen[0, 1] == 0


def test_what_is_not_supported_is_named(tmp_path):
    model = read_model(saved(tmp_path, OBJ + "l 1 2\n", MTL + "map_Bump a.png\nnorm b.png\n"))
    assert model.left_out == ["l lines", "MTL map_Bump", "MTL norm"]


@pytest.mark.parametrize(
    ("obj", "mtl", "says"),
    [
        (OBJ, MTL.replace("Kd 0 0 1", "Kd 0 x 1"), "a.mtl: glass: Kd '0 x 1': numbers of at least 0 are needed"),
        (OBJ, MTL.replace("Kd 0 0 1", "Kd"), "a.mtl: glass: Kd '': numbers of at least 0 are needed"),
        (OBJ, MTL.replace("Kd 0 0 1", "Kd -1 0 1"), "a.mtl: glass: Kd '-1 0 1': numbers of at least 0 are needed"),
        (OBJ, MTL.replace("Tr 0.8", "Tr 8"), "glass: d or Tr leaves 8 to go through: a share from 0 to 1"),
        (OBJ.replace("1/1 2/2 3/3", "1/1 2/2 9/3"), MTL, "f '9/3': names a v that is not there: there are 4"),
        (OBJ.replace("1/1 2/2 3/3", "1/1 2/2 3/9"), MTL, "f '3/9': names a vt that is not there: there are 4"),
        (OBJ.replace("1/1 2/2 3/3", "1/1 2/2 -9/3"), MTL, "f '-9/3': names a v that is not there: there are 4"),
        (OBJ.replace("1/1 2/2 3/3", "1/1 2/2 0/3"), MTL, "f '0/3': names a v that is not there: there are 4"),
        (
            OBJ.replace("1/1 2/2 3/3", "1/1 2/2 " + "9" * 400),
            MTL,
            "whole numbers v, v/vt, v//vn or v/vt/vn are needed",
        ),
        (OBJ.replace("1/1 2/2 3/3", "1/1 2/2"), MTL, "f '1/1 2/2': at least three corners are needed"),
        (OBJ.replace("v 2 0 0", "v 2 0"), MTL, "v '2 0': 3 numbers are needed"),
        (OBJ.replace("v 2 0 0", "v 2 0 nan"), MTL, "v '2 0 nan': finite numbers are needed"),
        (OBJ.replace("v 2 0 0", "v 2 0 1" + "0" * 400), MTL, "finite numbers are needed"),
        ("v 0 0 0\n", MTL, "holds no triangles"),
    ],
)
def test_what_is_wrong_is_named(obj, mtl, says, tmp_path):
    with pytest.raises((ValueError, OSError)) as caught:
        read_model(saved(tmp_path, obj, mtl))
    assert str(caught.value).startswith("a.obj: ") and says in str(caught.value) and "\n" not in str(caught.value)


LOST = "materials that no MTL file has"


def test_missing_materials_and_pictures_are_named_and_the_rest_is_shown(tmp_path):
    """Earlier they were an error. Missing materials get the default grey, missing pictures are left out."""
    for obj, mtl, names, lost in (
        (
            OBJ.replace("a.mtl", "b.mtl"),
            MTL,
            ["mtllib b.mtl (not there)", "materials that no MTL file has: red one, glass"],
            2,
        ),
        (OBJ.replace("usemtl glass", "usemtl glas"), MTL, [f"{LOST}: glas"], 1),
        (OBJ, MTL.replace("Ni 1.45", "map_Kd no.png"), ["a.mtl: glass: map_Kd no.png (not there)"], 0),
        (OBJ, MTL.replace("Ni 1.45", "map_Kd ../x.png"), ["a.mtl: glass: map_Kd ../x.png (not there)"], 0),
        (OBJ, MTL.replace("Ni 1.45", "map_Kd C:\\x.png"), ["a.mtl: glass: map_Kd C:\\x.png (not there)"], 0),
    ):
        folder = tmp_path / "in"
        folder.mkdir(exist_ok=True)
        write_image(tmp_path / "x.png", np.zeros((2, 2, 3), np.uint8))  # there, but out of the file's folder
        model = read_model(saved(folder, obj, mtl))
        assert model.left_out == names
        assert sum(part.material is None for part in model.parts) == (3 if lost == 2 else 2 * lost)
        with pytest.warns(UserWarning, match="a.obj: not supported or not there, and left out: ") as warned:
            load_scene(folder / "a.obj")
        assert all(name in str(warned[0].message) for name in names)


def test_a_picture_without_texture_coordinates_is_left_out(tmp_path):
    write_image(tmp_path / "c.png", np.zeros((2, 2, 3), np.uint8))
    obj = OBJ.replace("f 1/1 3/3 4/4", "f 1 3 4")
    model = read_model(saved(tmp_path, obj, MTL.replace("Ni 1.45", "map_Kd c.png")))
    assert model.left_out == ["map_Kd of glass (no texture coordinates)"]
    assert [part.material.texture is None for part in model.parts] == [True, True, False]


def test_d_wins_over_tr(tmp_path):
    """Many exporters write `d 1` and `Tr 1` for opaque materials: by Tr they would be invisible."""
    for lines, gone in (("d 1\nTr 1", 0), ("Tr 1\nd 1", 0), ("Tr 0\nd 0.25", 0.75), ("d 1.000001", 0)):
        path = saved(tmp_path, OBJ, MTL.replace("Tr 0.8", lines).replace("Tf 1 0.5 0.25\n", ""))
        assert read_model(path).parts[-1].material.transmission == (gone,) * 3


@pytest.mark.parametrize("more, gone", [("", 0), ("illum 2\nNi 0", 0), ("Ni 1.5", 1), ("Tf 1", 1), ("illum 6", 1)])
def test_tr_1_alone_is_meshlabs_opaque(tmp_path, more, gone):
    """A capsule and a face of trimesh's models, saved by MeshLab with `Tr 1`, were invisible."""
    model = read_model(saved(tmp_path, OBJ, MTL.replace("Tf 1 0.5 0.25\nNi 1.45", more).replace("Tr 0.8", "Tr 1")))
    assert model.parts[-1].material.transmission == (gone,) * 3
    assert model.parts[-1].material.ior == (1.5 if "1.5" in more else 1)
    assert model.left_out == ([] if gone else ["Tr 1, by which MeshLab means opaque"])


def test_colours_of_an_objs_vertices(tmp_path):
    """Three more numbers of a v are sRGB and multiply Kd; earlier they were dropped without a warning."""
    codes = [(1, 0, 0), (0, 0.5, 0), (0, 0, 1), (1, 1, 1)]
    obj = "\n".join(f"v {x} {y} 0 {r} {g} {b}" for (x, y), (r, g, b) in zip(
        ((0, 0), (1, 0), (1, 1), (0, 1)), codes, strict=True)) + "\nf 1 2 3\nf 1 3 4\n"  # fmt: skip
    (part,) = read_model(saved(tmp_path, obj)).parts
    assert isinstance(part.material.texture, VertexColours) and part.material.colour == (1, 1, 1)
    order = np.lexsort((part.mesh.vertices[:, 0], part.mesh.vertices[:, 1]))
    np.testing.assert_allclose(part.mesh.colours[order], linear(np.array(codes)[[0, 1, 3, 2]]))
    bytes_ = obj.replace("0.5", "127.5").replace(" 1 0 0\n", " 255 0 0\n", 1)
    assert read_model(saved(tmp_path, bytes_)).parts[0].mesh.colours.max() == 1
    (part,) = read_model(saved(tmp_path, "mtllib a.mtl\nusemtl red one\n" + obj)).parts
    np.testing.assert_allclose(part.material.colour, linear([0.5, 0.25, 0]))
    assert isinstance(part.material.texture, VertexColours)


def test_names_that_are_not_utf_8_or_hold_brackets(tmp_path):
    data = OBJ.replace("left", "[/red]").replace("right", "\\x1b[31m").encode() + "o größe\nf 1 2 3\n".encode(
        "latin-1"
    )
    saved(tmp_path)
    (tmp_path / "a.obj").write_bytes(data)
    names = [part.name for part in read_model(tmp_path / "a.obj").parts]
    assert names[0] == "[/red]_red one" and names[-1].startswith("gr")


def test_colours_of_a_plys_vertices(tmp_path):
    box = trimesh.creation.box((2, 2, 2))
    box.visual.vertex_colors = np.tile([255, 128, 0, 255], (8, 1))
    box.export(tmp_path / "b.ply")
    (part,) = read_model(tmp_path / "b.ply").parts
    assert isinstance(part.material.texture, VertexColours)
    np.testing.assert_allclose(part.mesh.colours, np.tile(linear([1, 128 / 255, 0]), (24, 1)))  # sharp edges
    (tmp_path / "s.toml").write_text('ambient = 1\n[[object]]\nname = "b"\nmesh = "b.ply"\n')
    scene = load_scene(tmp_path / "s.toml")
    assert scene.bodies[0].name == "b"
    np.testing.assert_allclose(
        trace(scene, [(0, 0, -5)], [(0, 0, 1)]).radiance[0], linear([1, 128 / 255, 0]), rtol=1e-5
    )


def test_a_file_without_materials_has_the_default_grey(tmp_path):
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "b.stl")
    (tmp_path / "s.toml").write_text('ambient = 1\n[[object]]\nmesh = "b.stl"\n')
    np.testing.assert_allclose(load_scene(tmp_path / "s.toml").bodies[0].material.colour, 0.8)


PLY = """ply
format ascii 1.0
comment TextureFile my maps.png
element vertex 5
property float x
property float y
property float z
element face 3
property list uchar int vertex_indices
property list uchar float texcoord
property uchar texnumber
end_header
0 0 0
2 0 0
2 1 0
0 1 0
3 0 0
4 0 1 2 3 8 0 0 1 0 1 1 0 1 0
2 1 2 4 0 0 1 1 0
3 1 4 2 6 0.5 0.5 0.5 0.5 0.5 0.5 0
"""


def test_meshlabs_picture_on_the_faces_of_a_ply(tmp_path):
    """Of trimesh's models, `fuze.ply` has the look of `fuze.obj`; a line between the faces has no corners here."""
    codes = np.array([[[250, 0, 0], [0, 250, 0]], [[0, 0, 250], [250, 0, 0]]], np.uint8)
    write_image(tmp_path / "my maps.png", codes)
    (tmp_path / "a.ply").write_text(PLY)
    (part,) = read_model(tmp_path / "a.ply").parts
    assert part.material.colour == (1, 1, 1) and len(part.material.texture.pixels) == 2
    found = dict(zip(map(tuple, part.mesh.vertices * [1, 1, -1]), part.mesh.uv.tolist(), strict=True))
    assert len(part.mesh.vertices) == 7, "two corners have two (u, v)"
    assert found[0, 0, 0] == [0, 0] and found[0, 1, 0] == [0, 1]
    (tmp_path / "s.toml").write_text('ambient = 1\n[[object]]\nname = "a"\nmesh = "a.ply"\n')
    places = np.array([(0.4, 0.2, -9), (1.6, 0.2, -9), (0.4, 0.8, -9), (1.6, 0.8, -9)])
    seen = trace(load_scene(tmp_path / "s.toml"), places, np.tile([0.0, 0, 1], (4, 1))).radiance
    assert seen.argmax(axis=1).tolist() == [2, 0, 0, 1], "blue, red; red, green: rows of a picture run down"


@pytest.mark.parametrize(
    ("change", "notes"),
    [
        (("comment TextureFile my maps.png\n", ""), []),
        (("my maps.png", "other.png"), ["TextureFile other.png (not there)"]),
        (("8 0 0 1 0 1 1 0 1 0", "6 0 0 1 0 1 1 0"), ["texture coordinates of faces"]),
        (("0.5 0\n", "0.5 1\n"), ["pictures but the first"]),
    ],
)
def test_what_of_a_plys_picture_is_left_out(tmp_path, change, notes):
    write_image(tmp_path / "my maps.png", np.zeros((2, 2, 3), np.uint8))
    (tmp_path / "a.ply").write_text(PLY.replace(*change))
    model = read_model(tmp_path / "a.ply")
    assert model.left_out == notes
    assert (model.parts[0].material is None) == (notes != ["pictures but the first"])
