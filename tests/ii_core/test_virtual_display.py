"""Rays that start behind the lenses, viewing zones that meet at a viewer, poses, and displays for a panel."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from codec import decode, encode
from ii_core import (
    IICamera,
    IIPicture,
    camera_pose,
    five_viewpoints,
    orthoscopic,
    panel_display,
    preset,
    refocus,
    view_image,
)
from ii_core.base.files import read_image
from ii_core.design.properties import viewing_zone
from ii_core.display.look import focused_view
from ii_core.display.viewer.page import _Page
from ii_core.picture.view import view_positions
from raytrace_ii import Scene, render
from raytrace_ii.rendering.job import disparity, footprint
from tests.support.trace_scenes import body, wall

CAMERA = IICamera(pixels=(84, 60), lenses=(14, 10), pixel_pitch_mm=0.25, gap_mm=2.0)  # 6×6 px under each lens
KINDS = {
    f"{optics}, {'meeting' if viewer else 'parallel'}, start {start}": replace(
        CAMERA, optics=(optics,), viewer_mm=viewer, start_mm=start, lens_pitch_mm=None
    )
    for optics in ("pinhole", "grin")
    for viewer in (None, 90.0)
    for start in (0.0, 40.0)
}


@pytest.mark.parametrize("optics", ["pinhole", "grin", {"kind": "lenslet", "focal_mm": 1.9, "aperture_mm": 0.5}])
def test_rays_start_behind_the_lenses_on_the_same_lines(optics):
    at_lenses = replace(CAMERA, optics=(optics,))
    L, D = at_lenses.rays(place=(0.9, 0.4))
    back, same = replace(at_lenses, start_mm=30.0).rays(place=(0.9, 0.4))
    np.testing.assert_array_equal(D, same)
    np.testing.assert_allclose(back[..., 2], CAMERA.gap_mm - 30, atol=1e-12)
    np.testing.assert_allclose(np.cross(back - L, D), 0, atol=1e-10)  # rounding of coordinates of a few mm


@pytest.mark.parametrize("name", KINDS)
def test_a_view_takes_the_pixels_whose_rays_run_through_the_viewer(name):
    """By the camera's own rays: the line of each picked pixel's ray passes through the viewpoint."""
    camera, eye = KINDS[name], np.array([3.0, -2.0, -60.0])
    x, y = view_positions(camera, eye, erect=camera.erect)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    inside = [np.abs(p - (np.arange(n) * e + (e - 1) / 2)) < e / 2 for p, n, e in ((x, k, u), (y, l, v))]
    assert inside[0].sum() > 5 and inside[1].sum() > 5
    x, y = x[inside[0]], y[inside[1]]
    m, n = np.floor(x + 0.5), np.floor(y + 0.5)
    sample = np.stack(np.broadcast_arrays((x - m + 0.5)[None], (y - n + 0.5)[:, None]), axis=-1)
    L, D = camera.rays_at(m[None].astype(int), n[:, None].astype(int), sample)
    along = (eye[2] - L[..., 2]) / D[..., 2]
    np.testing.assert_allclose(L + D * along[..., None], np.broadcast_to(eye, L.shape), atol=1e-9)
    # Turned elementary images: the same pixels, each in its place of the turned image.
    turned_x, _ = view_positions(camera, eye, erect=not camera.erect)
    lens = np.flatnonzero(inside[0])
    np.testing.assert_allclose(turned_x[lens] - lens * u, u - 1 - (x - lens * u), atol=1e-9)


@pytest.mark.parametrize(("optics", "sign"), [("grin", 1), ("pinhole", -1)])
def test_viewing_zones_meet_at_the_viewer(optics, sign):
    camera = replace(CAMERA, optics=(optics,), viewer_mm=90.0, lens_pitch_mm=None)
    pitch = camera.lens_pitch_mm[0] * (1 + sign * camera.gap_mm / 90.0)  # closed form: p(1 ± g/d)
    assert camera.ei_pitch_mm[0] == pytest.approx(pitch, rel=1e-12) and pitch == pytest.approx(6 * 0.25)
    assert camera.regular and camera.ei_pixels == (6, 6)
    centres = [np.arange(n) * 6 + 3 for n in camera.lenses]  # the corner of four pixels
    L, D = camera.rays_at(centres[0][None], centres[1][:, None], (0.0, 0.0))
    seen = L - D * ((L[..., 2] - (camera.gap_mm - 90)) / D[..., 2])[..., None]
    np.testing.assert_allclose(seen, np.broadcast_to([0, 0, camera.gap_mm - 90], seen.shape), atol=1e-9)
    # At that distance the zone is as wide as for a single lens.
    zone = viewing_zone(camera)
    assert zone["usual_mm"] == 90 and zone["usual_width_mm"][0] == pytest.approx(pitch * 90 / camera.gap_mm)
    assert viewing_zone(replace(camera, viewer_mm=None, lens_pitch_mm=None))["usual_width_mm"][0] < 180
    for eye in five_viewpoints(camera).values():
        for position, count in zip(view_positions(camera, eye, erect=camera.erect), camera.lenses, strict=True):
            assert (np.abs(position - (np.arange(count) * 6 + 2.5)) <= 2.5 + 1e-9).all()


@pytest.mark.parametrize("name", KINDS)
def test_disparity_is_that_of_the_rays(name):
    """A point on the axis of a lens: where its neighbour sees it, found on the neighbour's rays."""
    camera, z = KINDS[name], 50.0
    positions = np.linspace(0, 6, 601)  # along the elementary image, in pixels
    places = []
    for k in (6, 7):
        m = np.minimum(np.floor(positions), 5)
        L, D = camera.rays_at(k * 6 + m.astype(int), 30, np.stack([positions - m, np.full(601, 0.5)], axis=-1))
        x = L[:, 0] + D[:, 0] * (z - L[:, 2]) / D[:, 2]
        order = np.argsort(x)
        places.append(np.interp(0.1, x[order], positions[order]))
    said = disparity(camera, np.array([[z]], np.float32))[0, 0]
    assert said == pytest.approx(places[1] - places[0], abs=1e-4)


def near_and_far():
    """A dark square 20 mm before the display plane, z = 2, and one 20 mm behind it; both on the axis."""
    squares = [
        body(wall(2.0 + z, half=1.0), name=str(z), emission=colour)
        for z, colour in ((-20, (1, 0, 0)), (20, (0, 0, 1)))
    ]
    squares[0].vertices[:, 1] += 3
    squares[1].vertices[:, 1] -= 3
    return Scene(bodies=squares)


def middle(view, channel):
    """Column of the middle of what is bright in a channel of a view."""
    weight = view[..., channel].astype(float).sum(axis=0)
    assert weight.sum() > 0
    return (weight * np.arange(weight.size)).sum() / weight.sum()


@pytest.mark.parametrize("name", [name for name in KINDS if "start 40" in name])
def test_content_before_and_behind_the_display_moves_to_opposite_sides(name):
    """If the viewer moves right, content behind the display moves right along it, content before it moves left."""
    fine = {"pixels": (336, 240), "lenses": (28, 20), "pixel_pitch_mm": 0.0625, "lens_pitch_mm": None}
    camera = replace(KINDS[name], **fine)
    shot = render(near_and_far(), camera, support=("depth",), samples=4)
    picture = shot.picture
    assert np.nanmin(shot.depth) == pytest.approx(-18) and np.nanmax(shot.depth) == pytest.approx(22)
    views = [view_image(picture, (x, 0, -88))[0] for x in (-8.0, 8.0)]
    red, blue = ([middle(view, channel) for view in views] for channel in (0, 2))
    assert red[1] < red[0] - 1 and blue[1] > blue[0] + 1
    # By hand: a viewer at x sees a point at distance h behind the display, on the axis, at x·h/(h + 90) on it.
    pitch = camera.lens_pitch_mm[0]
    assert blue[1] - blue[0] == pytest.approx(16 * 20 / 110 / pitch, abs=0.5)
    assert red[1] - red[0] == pytest.approx(-16 * 20 / 70 / pitch, abs=0.6)
    # Elementary images turned: the same views.
    np.testing.assert_array_equal(view_image(orthoscopic(picture), (8.0, 0, -88))[0], views[1])
    for depth, channel in ((-18.0, 0), (22.0, 2)):
        sharp, soft = (refocus(picture, z)[..., channel].max() for z in (depth, 4 - depth))
        assert sharp > 1.2 * soft
        one, two = (focused_view(picture, (x, 0, -88), depth_mm=depth)[..., [channel]] for x in (-1.0, 1.0))
        assert abs(middle(one, 0) - middle(two, 0)) < 1.0


def test_without_start_mm_bodies_before_the_display_are_not_seen():
    shot = render(near_and_far(), CAMERA, support=("depth",))
    assert np.nanmin(shot.depth) == pytest.approx(22)


def test_textures_at_the_display_plane_are_not_blurred():
    """The beams of neighbouring pixels meet at the lenses."""
    width, spread = footprint(replace(CAMERA, start_mm=40.0))
    assert spread == footprint(CAMERA)[1] > 0
    slant = math.hypot(1, 0.375, 0.375)  # of the longest way to the lenses
    assert -40 * slant * spread < width < -40 * spread


@pytest.mark.parametrize("name", KINDS)
def test_files_keep_start_and_viewer(name):
    camera = KINDS[name]
    assert IICamera.from_json(json.loads(json.dumps(camera.to_json()))) == camera
    picture = IIPicture(np.zeros((60, 84, 3), np.uint8), (14, 10), (6, 6), camera, camera.erect)
    assert decode(encode(picture, "si-ffv1")).camera == camera
    page = _Page(picture, None, None, "", 90, ())
    assert page.meta()["camera"]["viewer_mm"] == camera.viewer_mm


@pytest.mark.parametrize("name", KINDS)
def test_at_another_scale_rays_start_and_meet_where_they_did(name, tmp_path):
    camera = KINDS[name]
    path = tmp_path / "c.json"
    path.write_text(json.dumps(camera.to_json()))
    small = preset(path, scale=2)
    assert small.regular and small.ei_pixels == camera.ei_pixels
    assert small.start_mm == (camera.start_mm + 2 if camera.start_mm else 0)  # the lens plane goes from 2 to 4 mm
    assert small.viewer_mm == (camera.viewer_mm + 2 if camera.viewer_mm else None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"start_mm": -1}, "start_mm is -1: a distance from 0 to 1e.09 mm is needed"),
        ({"start_mm": math.inf}, "start_mm is inf"),
        (
            {"start_mm": 5, "optics": ({"kind": "lens", "z_mm": 9, "focal_mm": 3},)},
            "rays start at the lenses if a lens",
        ),
        ({"viewer_mm": 0}, "viewer_mm is 0: a length from"),
        ({"viewer_mm": 1.5, "lens_pitch_mm": None}, "viewer_mm is 1.5: more than gap_mm, 2, is needed"),
    ],
)
def test_start_and_viewer_out_of_range(change, said):
    with pytest.raises(ValueError, match=said):
        replace(CAMERA, **change)


# --- poses


def test_signs_of_turns():
    right, up, clockwise = (camera_pose(turn_deg=turn)[:3, :3] for turn in ((90, 0, 0), (0, 90, 0), (0, 0, 90)))
    np.testing.assert_allclose(right @ [0, 0, 1], [1, 0, 0], atol=1e-15)  # it looks to the right
    np.testing.assert_allclose(up @ [0, 0, 1], [0, 1, 0], atol=1e-15)  # it looks up
    np.testing.assert_allclose(clockwise @ [0, 1, 0], [1, 0, 0], atol=1e-15)  # its top goes right
    for turn in (right, up, clockwise):
        assert np.linalg.det(turn) == pytest.approx(1)


def test_a_camera_looks_at_a_point_with_its_top_up():
    pose = camera_pose((10, 20, -30), look_at_mm=(40, 20, 10))
    np.testing.assert_allclose(pose[:3, :3] @ [0, 0, 50] + pose[:3, 3], [40, 20, 10])
    np.testing.assert_allclose(pose[:3, 1], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 0], [0.8, 0, -0.6])  # its right: clockwise seen from above
    np.testing.assert_array_equal(camera_pose((1, 2, 3))[:3], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]])
    assert camera_pose(up=(1, 0, 0))[:3, 1] == pytest.approx([1, 0, 0])
    with pytest.raises(ValueError, match="at_mm and look_at_mm are one point"):
        camera_pose((1, 2, 3), look_at_mm=(1, 2, 3))
    with pytest.raises(ValueError, match=r"up is \[0.0, 0.0, 2.0\]: a direction other than that of sight"):
        camera_pose(up=(0, 0, 2))


@pytest.mark.slow
def test_the_command_turns_the_camera(run, refused, tmp_path):
    """A body to the right of the camera fills its picture after a rotation to the right."""
    (tmp_path / "s.toml").write_text(
        '[background]\nhorizon = "#000000"\n[material.white]\ncolour = "#ffffff"\nemission = "#ffffff"\n'
        '[[object]]\nshape = "box"\nsize_mm = [20, 200, 200]\nposition_mm = [60, 0, 0]\nmaterial = "white"\n'
    )
    command = ["render", tmp_path / "s.toml", "--scale", 64, "--force", "-o", tmp_path / "p.png"]
    seen = {}
    for name, words in {"ahead": [], "right": ["--turn", "90"], "look": ["--look-at", "60,0,0"]}.items():
        code, _, error = run(*command, *words, "--projection", tmp_path / "flat.png")
        assert code == 0, error
        flat = read_image(tmp_path / "flat.png").mean()  # on d5f6140 it saw ahead, however the camera stood
        assert flat == 0 if name == "ahead" else flat > 100
        seen[name] = IIPicture.load(tmp_path / "p.png").pixels.mean()
    assert seen["ahead"] == 0 and seen["right"] == seen["look"] == 255
    refused(run(*command, "--turn", "1,2,3,4"), "turn is '1,2,3,4': one to three numbers as in 20,-5 are needed")
    refused(run(*command, "--look-at", "1,2"), "look-at is '1,2': three numbers x,y,z are needed")


# --- displays designed for a panel

PANEL = {"size_mm": 15.6 * 25.4, "pixels": (3840, 2160), "lens_pitch_mm": 1.0, "viewer_mm": 600.0}


def test_a_display_for_a_panel_in_closed_form():
    made = panel_display(**PANEL)
    camera, pixel = made.camera, 15.6 * 25.4 / math.hypot(3840, 2160)
    assert camera.pixel_pitch_mm == pytest.approx(pixel)
    assert camera.ei_pixels == (12, 12) and camera.lenses == (320, 180) and camera.regular
    assert camera.view_angle_deg == pytest.approx(30)
    assert camera.ei_pitch_mm[0] == pytest.approx(12 * pixel)
    assert camera.ei_pitch_mm[0] == pytest.approx(camera.lens_pitch_mm[0] * (1 + camera.gap_mm / 600))
    assert camera.erect and camera.start_mm == 300 and camera.viewer_mm == 600
    assert made.notes[0] == "12 pixels under a lens: a lens pitch of 1.07563 mm for the 1 mm given"
    # Through the outermost lenses, too, light goes to the viewer: from the middle of the first elementary image.
    L, D = camera.rays_at(6, 6, (0.0, 0.0))
    np.testing.assert_allclose(L - D * ((600 - 300) / camera.gap_mm), [0, 0, camera.gap_mm - 600], atol=1e-9)


def test_an_enlarged_scene_is_seen_through_a_smaller_display():
    large, camera = panel_display(**PANEL, enlarge=7).camera, panel_display(**PANEL).camera
    (a, b), (c, d) = large.rays_at(5, 700), camera.rays_at(5, 700)
    np.testing.assert_allclose(a * 7, c)
    np.testing.assert_allclose(b * 7, d)
    assert large.viewer_mm * 7 == pytest.approx(600) and large.pixels == camera.pixels and large.regular
    with pytest.raises(ValueError, match="enlarge is 0: a positive factor"):
        panel_display(**PANEL, enlarge=0)


def test_a_sheet_that_is_there_keeps_its_pitch_and_lenses_off_the_panel_are_said():
    made = panel_display(**PANEL, lenses=(345, 190), gap_mm=2.5)
    assert made.camera.lens_pitch_mm == (1.0, 1.0) and not made.camera.regular
    assert made.camera.ei_pixels[0] == pytest.approx((1 + 2.5 / 600) / made.camera.pixel_pitch_mm, rel=1e-8)
    # 345.353 mm of panel hold 343.9 elementary images of 1.00417 mm
    assert any("warning: 2 of 345 columns of lenses" in note and "at most 343" in note for note in made.notes)
    assert not any("rows" in note for note in made.notes)
    L, _ = made.camera.rays_at(1920, 1080, (0.0, 0.0))
    assert abs(L[0]) < 1e-9 or abs(abs(L[0]) - 0.5) < 1e-9


def test_a_panel_whose_sides_nothing_divides_is_used_in_part():
    made = panel_display(size_mm=(345.0, 194.0), pixels=(1366, 768), lens_pitch_mm=2.5, viewer_mm=500.0)
    assert made.camera.ei_pixels == (10, 10) and made.camera.pixels == (1360, 760)
    assert any("1360×760 of the panel's pixels" in note for note in made.notes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"lens_pitch_mm": 0.1}, "a lens of 0.1 mm covers 1.11 pixels of 0.08994 mm: at least 2 are needed"),
        ({"gap_mm": 2.0, "view_angle_deg": 20.0}, "both given"),
        ({"view_angle_deg": 180}, "an angle between 0 and 180"),
        ({"size_mm": 0}, "size_mm is 0"),
    ],
)
def test_impossible_designs_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        panel_display(**PANEL | change)


def test_the_command_designs_a_camera_that_renders(run, refused, tmp_path):
    wish = "panel=15.6in,pixels=3840x2160,pitch=1mm,distance=60cm"
    file = tmp_path / "panel.json"
    code, out, error = run("camera", "--design", wish, "-o", file)
    assert code == 0, error
    assert "zones meet         600 mm" in out and "12 pixels under a lens" in out
    assert preset(file) == replace(panel_display(**PANEL).camera, name="panel")
    code, _, error = run(
        "render", "objects", "--camera", file, "--scale", 20, "--at", "0,0,40", "-o", tmp_path / "p.png"
    )
    assert code == 0, error
    assert IIPicture.load(tmp_path / "p.png").camera.start_mm > 300
    refused(run("camera", "--design", wish, "-o", file), "is there already")
    refused(run("camera", "--design", "panel=15.6in,pixels=3840x2160"), "the design has no pitch, distance")
    refused(run("camera", "--design", wish + ",size=3"), "'size=3' is unknown for --design: known are panel, pixels")
    refused(run("camera", "--design", wish + ",gap=2ft"), "gap is '2ft': a number, or a length in mm, cm, m, in")
