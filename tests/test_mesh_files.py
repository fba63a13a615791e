"""Mesh files as shapes: not mirrored, with normals and texture coordinates."""

import math
import struct

import numpy as np
import pytest
import trimesh
from test_load import CHECKER, ball, load

from ii_core.files import write_image
from raytrace_ii import trace
from raytrace_ii.files.load import read_model

# A foot with four toes of different lengths: like none of its mirror images. Right-handed, as files are.
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


def test_meshes_shade_flat_if_asked_to(tmp_path):
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


def test_a_binary_stl_of_no_area_draws_nothing(tmp_path):
    triangle = struct.pack("<12fH", 0, 0, 0, *[0.0] * 9, 0)
    (tmp_path / "point.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 1) + triangle)
    scene = load(tmp_path, ball('shape = "sphere"\nradius_mm = 1', 'mesh = "point.stl"'))
    seen = trace(scene, [(0, 0, -5)], [(0, 0, 1)])
    assert seen.object_id[0] == -1 and math.isnan(seen.depth[0])
