"""Mesh files as shapes: handedness, normals, texture coordinates."""

import struct

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core.base.files import write_image
from raytrace_ii import load_scene, trace
from raytrace_ii.files.load import read_model
from raytrace_ii.files.polygons import triangulated
from raytrace_ii.scene.textures import linear
from raytrace_ii.shapes.primitives import Sphere, rotation
from tests.raytrace_ii.files.test_load import CHECKER, ball, load

# A foot with four toes of different lengths, unlike all its mirror images. Right-handed, as in files.
CORNERS = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def mesh_file(tmp_path, kind):
    mesh = trimesh.Trimesh(CORNERS, FACES, process=False)
    assert mesh.is_watertight and mesh.volume > 0
    path = tmp_path / f"foot.{kind}"
    mesh.export(path, **({"include_normals": True} if kind == "glb" else {}))
    return path


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb", "gltf"])
def test_mesh_files_are_not_mirrored(kind, tmp_path):
    """Into our left-handed frame by z → −z: the body looks the same, and its faces point out."""
    if kind == "gltf":
        foot = trimesh.Trimesh(CORNERS, FACES, process=False).scene()
        for name, content in foot.export(file_type="gltf", include_normals=True).items():
            (tmp_path / name).write_bytes(content)
        path = (tmp_path / "model.gltf").rename(tmp_path / "foot.gltf")
    else:
        path = mesh_file(tmp_path, kind)
    mesh = read_model(path).parts[0].mesh
    p = mesh.vertices[mesh.faces]
    np.testing.assert_allclose(np.unique(p.reshape(-1, 3).round(6), axis=0), np.unique(CORNERS * [1, 1, -1], axis=0))
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    outward = np.einsum("ij,ij->i", normal, p.mean(axis=1) - p.reshape(-1, 3).mean(axis=0))
    assert (outward > 0).all()
    volume = np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6
    assert volume == pytest.approx(1.0)  # 3·2·1/6
    assert (np.einsum("fcj,fj->fc", mesh.normals[mesh.faces], normal) > 0).all()

    # Seen through the whole chain: a foot before the camera, its long toe to the right, the middle one up, the short
    # one, +z of the file, towards the viewer.
    scene = load(tmp_path, ball('shape = "sphere"\nradius_mm = 1', f'mesh = "{path.name}"\nposition_mm = [0, 0, 10]'))
    assert scene.bodies[0].name.partition("/")[0] == "foot 0"
    np.testing.assert_allclose(scene.bounds_mm, [[0, 0, 9], [3, 2, 10]], atol=1e-6)
    aims = np.array([[2.9, 0.01, 0], [0.01, 1.9, 0], [0.01, 0.01, 0], [-0.1, 0.1, 0], [2.9, 1.9, 0]])
    seen = trace(scene, aims, np.broadcast_to([0.0, 0, 1], aims.shape))
    np.testing.assert_array_equal(seen.object_id, [0, 0, 0, -1, -1])
    assert seen.depth[2] == pytest.approx(9, abs=0.02)
    assert (seen.normal[:3, 2] < 0).all(), "the side seen faces the viewer"


def test_meshes_shade_flat_on_request(tmp_path):
    path = mesh_file(tmp_path, "ply")
    assert read_model(path).parts[0].mesh.normals is not None
    flat = load(tmp_path, ball('shape = "sphere"\nradius_mm = 1', 'mesh = "foot.ply"\nsmooth = false'))
    assert flat.bodies[0].normals is None


def test_a_meshs_texture_coordinates_are_kept(tmp_path):
    (tmp_path / "sheet.obj").write_text(
        "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    # red at the top left, which is v = 1 and u = 0, and black elsewhere
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = 255, 0, 0
    write_image(tmp_path / "corner.png", pixels)
    scene = load(
        tmp_path,
        """
        ambient = 1
        [texture.t]
        kind = "image"
        file = "corner.png"
        [material.m]
        texture = "t"
        [[object]]
        mesh = "sheet.obj"
        material = "m"
        position_mm = [0, 0, 5]
        """,
    )
    centres = np.array([[0.5, 0.75, 0], [1.5, 0.75, 0], [0.5, 0.25, 0], [1.5, 0.25, 0]])
    seen = trace(scene, centres, np.broadcast_to([0.0, 0, 1], centres.shape))
    np.testing.assert_allclose(seen.radiance[:, 0], [1, 0, 0, 0], atol=1e-6)
    without = ball('shape = "sphere"\nradius_mm = 1', 'mesh = "foot.ply"').replace(
        'colour = "#808080"', 'texture = "t"'
    )
    mesh_file(tmp_path, "ply")
    with pytest.raises(
        ValueError, match=r"object\.0: a texture on the surface needs texture coordinates, the mesh has"
    ):
        load(tmp_path, CHECKER + 'on = "surface"\n' + without)
    load(tmp_path, CHECKER + without)


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "glb"])
def test_a_file_of_triangles_without_area_is_refused(kind, tmp_path):
    """Earlier it rendered an empty picture without a warning, and this test accepted that."""
    line = np.array([[0, 0, 0], [1, 1, 1], [3, 3, 3.0]])
    path = tmp_path / f"line.{kind}"
    trimesh.Trimesh(line, [[0, 1, 2], [0, 0, 1]], process=False).export(path)
    with pytest.raises(ValueError, match=rf"line\.{kind}: holds no triangles with an area"):
        load_scene(path)
    dot = struct.pack("<12fH", 0, 0, 0, *[0.0] * 9, 0)
    (tmp_path / "point.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 1) + dot)
    with pytest.raises(ValueError, match=r"object\.0: point\.stl: holds no triangles with an area"):
        load(tmp_path, ball('shape = "sphere"\nradius_mm = 1', 'mesh = "point.stl"'))


# Smooth normals where a file has none


def angles(mesh, radial):
    """Degrees between a mesh's normals and the surface's own."""
    return np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", mesh.normals, radial), -1, 1)))


def ball_file(path, segments=24):
    """An OBJ of a ball without vn, whose texture has a seam and whose poles have many corners; radius 1."""
    mesh = Sphere(shape="sphere", radius_mm=1, segments=segments).mesh()
    places, place = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    lines = [f"v {x} {y} {-z}" for x, y, z in places] + [f"vt {u} {v}" for u, v in mesh.uv]
    corners = [f"{v + 1}/{vt + 1}" for vt, v in enumerate(place.reshape(-1))]
    lines += ["f " + " ".join(corners[i] for i in face[::-1]) for face in mesh.faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_seam_of_texture_coordinates_does_not_show(tmp_path):
    """Earlier, normals were averaged only over corners of one (u, v), and were tilted at the seam."""
    mesh = read_model(ball_file(tmp_path / "ball.obj")).parts[0].mesh
    off = angles(mesh, mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True))
    assert off.max() < 0.7  # of 15° from face to face: the triangles of a place are not symmetric about it
    assert len(mesh.vertices) == 13 * 25 - 2  # the seam's vertices are two, and one corner of each pole is in no face


@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_files_without_normals_are_smooth_up_to_an_edge(kind, tmp_path):
    """A cylinder's side is smooth and its rims are sharp; earlier STL stayed flat with smooth = true."""
    path = tmp_path / f"c.{kind}"
    made = trimesh.creation.cylinder(radius=1, height=2, sections=32)
    made.export(path, **({"include_normals": False} if kind == "obj" else {}))
    mesh = read_model(path).parts[0].mesh
    side = np.abs(mesh.normals[:, 2]) < 0.5
    np.testing.assert_allclose(mesh.normals[~side], np.broadcast_to([0, 0, 1], (33 * 2, 3)) * np.sign(
        mesh.vertices[~side, 2:]), atol=1e-6)  # fmt: skip
    round_ = mesh.vertices[side] * [1, 1, 0]
    np.testing.assert_allclose(mesh.normals[side], round_, atol=1e-6)
    assert side.sum() == 64, "one vertex a place and side: nothing is split that needs not be"


def test_a_cube_keeps_its_edges_and_an_obj_its_smoothing_groups(tmp_path):
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    quads = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    path = tmp_path / "cube.obj"

    def cube(*groups):
        path.write_text(corners + "".join(f"{s}f {q}\n" for s, q in zip(groups, quads, strict=True)))
        return read_model(path).parts[0].mesh

    sharp = cube(*[""] * 6)
    assert len(sharp.vertices) == 24 and set(np.abs(sharp.normals).ravel().round(9)) == {0, 1}
    smooth = cube(*["s 1\n"] * 6)
    assert len(smooth.vertices) == 8
    np.testing.assert_allclose(np.abs(smooth.normals), 1 / np.sqrt(3), atol=1e-9)
    for off in ("s off\n", "s 0\n"):
        assert set(np.abs(cube(*[off] * 6).normals).ravel().round(9)) == {0, 1}
    assert len(cube(*["s 1\n"] * 2, *["s 2\n"] * 4).vertices) == 8 + 8, (
        "two caps, one belt: both smooth by themselves"
    )


def test_normals_of_a_file_are_kept_and_missing_ones_made(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 3 0 4\nvn 0 0 0\nf 1//1 2//1 3//2\n"
    (tmp_path / "n.obj").write_text(text)
    mesh = read_model(tmp_path / "n.obj").parts[0].mesh
    by_place = {tuple(v): n for v, n in zip(mesh.vertices, mesh.normals, strict=True)}
    np.testing.assert_allclose(by_place[0, 0, 0], [0.6, 0, -0.8])
    np.testing.assert_allclose(by_place[0, 1, 0], [0, 0, -1])  # of length 0 there: the face's


# Polygons


def area(mesh):
    p = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2


CONCAVE = {
    "L": ([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 3),
    "arrow": ([(0, 0), (2, -1), (0, 2), (-2, -1)], 4),
    "arrow from its notch": ([(2, -1), (0, 2), (-2, -1), (0, 0)], 4),
    "comb": ([(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)], 13),
    "straight corners": ([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 1.5), (1, 2), (0, 2), (0, 1)], 3),
    "square ring with a slit": (
        [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)], 8),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["obj", "ply"])
@pytest.mark.parametrize("name", CONCAVE)
def test_concave_polygons_have_their_area(name, kind, tmp_path):
    """A fan from the first corner also covers area outside the polygon: +20 % on a public model."""
    outline, expected = CONCAVE[name]
    turn = rotation((20, -35, 50))  # in no plane of the axes
    for points in (outline, outline[2:] + outline[:2]):
        corners = np.column_stack([points, np.zeros(len(points))]) @ turn.T
        path = tmp_path / f"p.{kind}"
        if kind == "obj":
            lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in corners]
            path.write_text("\n".join(lines) + "\nf " + " ".join(map(str, range(1, len(points) + 1))) + "\n")
        else:
            head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
            head += "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            rows = [f"{x:.12g} {y:.12g} {z:.12g}" for x, y, z in corners]
            path.write_text(head + "\n".join(rows) + f"\n{len(points)} " + " ".join(map(str, range(len(points)))))
        mesh = read_model(path).parts[0].mesh
        assert area(mesh) == pytest.approx(expected, rel=1e-9)
        p = mesh.vertices[mesh.faces]
        whole = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        ahead = (turn @ [0, 0, 1]) * [1, 1, -1]
        assert (whole @ ahead >= -1e-9).all(), "no triangle is turned over"


@settings(max_examples=100)
@given(st.lists(st.floats(0.2, 1), min_size=3, max_size=40), st.integers(0, 360))
def test_star_shaped_polygons_of_any_outline_have_their_area(radii, lean):
    """Corners at equal angles around a centre from which all are visible."""
    angle = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    points = np.column_stack([radii * np.cos(angle), radii * np.sin(angle), np.zeros(len(radii))])
    exact = 0.5 * np.sum(np.array(radii) * np.roll(radii, -1)) * np.sin(2 * np.pi / len(radii))
    points = points @ rotation((lean, 10, 2 * lean)).T
    triangles = triangulated(points, np.array([len(radii)]))
    assert triangles.shape == (len(radii) - 2, 3)
    p = points[triangles]
    assert np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2 == pytest.approx(exact)


# PLY


def test_triangle_strips_of_ply(tmp_path):
    """As in files of scanners: every second triangle reversed, −1 between strips."""
    places = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (5, 0), (5, 1), (6, 0)]
    strip = [0, 2, 1, 3, -1, 6, 8, 7]
    head = "ply\nformat {}\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    text = head.format("ascii 1.0") + "".join(f"{x} {y} 0\n" for x, y in places) + "8 " + " ".join(map(str, strip))
    (tmp_path / "ascii.ply").write_text(text)
    for name, order in (("little", "<"), ("big", ">")):
        numbers = b"".join(struct.pack(f"{order}3f", x, y, 0) for x, y in places)
        numbers += struct.pack(f"{order}9i", 8, *strip)
        (tmp_path / f"{name}.ply").write_bytes(head.format(f"binary_{name}_endian 1.0").encode() + numbers)
    for name in ("ascii", "little", "big"):
        mesh = read_model(tmp_path / f"{name}.ply").parts[0].mesh
        assert len(mesh.faces) == 3 and area(mesh) == 1.5
        np.testing.assert_allclose(mesh.normals, np.broadcast_to([0, 0, -1], mesh.normals.shape))


def test_polygons_of_ply_of_different_sizes_in_any_coding(tmp_path):
    """A triangle and a square, with unneeded values between them."""
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 3)]
    head = "ply\nformat {}\ncomment by hand\nelement vertex 5\n"
    head += "property float x\nproperty float y\nproperty double z\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\nproperty uchar flag\n"
    head += "property list uchar uint vertex_index\nelement edge 1\nproperty int a\nend_header\n"
    rows = "".join(f"{x} {y} 0 255 0 128\n" for x, y in corners)
    (tmp_path / "ascii.ply").write_text(head.format("ascii 1.0") + rows + "7 4 0 1 2 3\n7 3 3 2 4\n5\n")
    for name, order in (("little", "<"), ("big", ">")):
        data = b"".join(struct.pack(f"{order}ffd3B", x, y, 0, 255, 0, 128) for x, y in corners)
        data += struct.pack(f"{order}BB4IBB3Ii", 7, 4, 0, 1, 2, 3, 7, 3, 3, 2, 4, 5)
        (tmp_path / f"{name}.ply").write_bytes(head.format(f"binary_{name}_endian 1.0").encode() + data)
    for name in ("ascii", "little", "big"):
        model = read_model(tmp_path / f"{name}.ply")
        mesh = model.parts[0].mesh
        assert len(mesh.faces) == 3 and area(mesh) == 5 and model.left_out == ["element edge"]
        np.testing.assert_allclose(mesh.colours, np.broadcast_to(linear([1, 0, 128 / 255]), (5, 3)))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ("element vertex 3", "element vertex 999999999999"),
            "element vertex: the file does not hold 999999999999 of it",
        ),
        (("element vertex 3", "element vertex " + "9" * 400), "is no line of PLY 1.0"),
        (("element face 1", "element face 2"), "element face: the file does not hold 2 of it"),
        (("\n3 0 1 2", "\n999999999 0 1 2"), "element face: the file does not hold 1 of it"),
        (("\n3 0 1 2", "\n3 0 1 7"), "names vertex 7, there are 3"),
        (("\n3 0 1 2", "\n3 0 1 -1"), "names vertex -1, there are 3"),
        (("\n3 0 1 2", "\n2 0 1"), "holds no triangles"),
        (("property float z\n", ""), "has no element vertex with x, y and z"),
        (("property float z", "property float x"), "element vertex: property x stands there twice"),
        (("0 1 0\n", "0 inf 0\n"), "holds vertices that are not finite numbers"),
        (("ascii", "EBCDIC"), "header: 'format EBCDIC 1.0' is no line of PLY 1.0"),
        (("ply", "PNG"), "has no PLY header"),
    ],
)
def test_damaged_ply_files(change, says, tmp_path):
    text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    text += "element face 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    (tmp_path / "d.ply").write_text(text.replace(*change))
    with pytest.raises(ValueError) as caught:
        read_model(tmp_path / "d.ply")
    assert str(caught.value).startswith("d.ply: ") and says in str(caught.value), str(caught.value)


def test_rows_of_ply_with_false_lengths(tmp_path):
    """trimesh gives every binary list the length of the first, and reads ASCII values to the end of their row."""
    head = "ply\nformat {} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 3)]
    places = b"".join(struct.pack("<3f", x, y, 0) for x, y in corners)
    # 17 + 13 + 21 bytes of lists are as long as three of the first
    rows = struct.pack("<B4iB3iB5i", 4, 0, 1, 2, 3, 3, 3, 2, 4, 5, 0, 1, 2, 4, 3)
    (tmp_path / "b.ply").write_bytes(head.format("binary_little_endian", 3).encode() + places + rows)
    assert area(read_model(tmp_path / "b.ply").parts[0].mesh) == 4 + 1 + 5
    text = head.format("ascii", 2) + "".join(f"{x} {y} 0 7\n\n" for x, y in corners)
    (tmp_path / "a.ply").write_text(text + "3 0 1 2 3\n4 0 1 2 3\n")  # a triangle with a word too many
    assert area(read_model(tmp_path / "a.ply").parts[0].mesh) == 2 + 4
    (tmp_path / "a.ply").write_text(text + "3 0 1 2\n4 0 1 2\n")
    with pytest.raises(ValueError, match="element face: the file does not hold 2 of it"):
        read_model(tmp_path / "a.ply")


# STL


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_damaged_stl_files(kind, tmp_path):
    path = tmp_path / "d.stl"
    trimesh.Trimesh(CORNERS, FACES, process=False).export(path, file_type=kind)
    data = path.read_bytes()
    assert len(read_model(path).parts[0].mesh.faces) == 4
    path.write_bytes(data + b"\n")
    assert len(read_model(path).parts[0].mesh.faces) == 4, "a byte more does no harm"
    path.write_bytes(data[: len(data) // 2])
    says = "corners, 0 of them readable" if kind == "stl_ascii" else "are needed: the file is cut off"
    with pytest.raises(ValueError, match=rf"^d\.stl: has \d+ .*{says}"):
        read_model(path)
    if kind == "stl_ascii":
        path.write_bytes(data.replace(b"vertex 3.0", b"vertex three"))
        with pytest.raises(ValueError, match=r"^d\.stl: cannot be read as STL: [^\n]+$"):
            read_model(path)
        path.write_bytes(data.replace(b"solid ", b"solid vertex of "))
        assert len(read_model(path).parts[0].mesh.faces) == 4
        path.write_bytes(data + data)
        assert len(read_model(path).parts[0].mesh.faces) == 8, "two solids"
