"""Order of convergence of meshes, against the closed-form ray tracer."""

import re

import numpy as np
import pytest

from benchmarks.accuracy import convergence, povray
from benchmarks.accuracy.analytic import Ball, Floor, World, reflectance, still_life
from benchmarks.accuracy.real_lenses import LENSES, ideal_twin, magnification, real_camera, slope
from ii_core import preset
from ii_core.design.properties import through_front_mm
from raytrace_ii import Light, Material, trace

LEVELS = [24, 48, 96, 192]


@pytest.fixture(scope="module")
def rows():
    return convergence.balls(LEVELS, preset("setup1", scale=32))


# Three halvings, sampled at pixels: fitted orders were within 0.05 of theory for geometry, within 0.25 for light.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("position", 0.1),
        ("depth", 0.1),
        ("normal_flat", 0.1),
        ("normal_smooth", 0.1),
        ("radiance_flat", 0.2),
        ("radiance_smooth", 0.35),
    ],
)
def test_errors_fall_with_the_expected_order_in_mesh_size(rows, name, within):
    assert convergence.order(rows, name, skip=0) == pytest.approx(convergence.ORDERS[name], abs=within)


@pytest.mark.slow
def test_the_picture_of_a_fine_mesh_equals_the_closed_form(rows):
    """Outlines dominate the error: the share of wrong pixels falls with h², the root mean square error with h."""
    assert rows[-1]["psnr_smooth"] > 48
    assert rows[-1]["psnr_smooth"] - rows[0]["psnr_smooth"] > 3 * 20 * np.log10(2) * 0.7
    assert all(row["psnr_smooth"] > row["psnr_flat"] + 3 for row in rows)


def test_lenses_of_triangles_focus_by_snell():
    """A plano-convex lens: `test_camera_of_glass`."""
    rows = convergence.ball_lens([48, 96, 192])
    assert convergence.order(rows, "smooth") == pytest.approx(2, abs=0.3)
    assert convergence.order(rows, "flat") == pytest.approx(1, abs=0.2)


def test_images_of_a_ball_lens_lie_at_gauss_distance():
    """At a fiftieth of the radius spherical aberration is some 1e-4 of the distance; the mesh of 192 adds as much."""
    assert max(abs(row["off"]) for row in convergence.images(192)) < 4e-3


def test_most_rays_have_equal_light_with_and_without_triangles():
    """The floor's rays hit no mesh: float32 hits against float64 in closed form."""
    world = still_life()
    L, D = preset("setup1", scale=32).rays()
    o, d = L.reshape(-1, 3), D.reshape(-1, 3)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    error = np.abs(trace(world.scene(192), o, d).radiance - world.radiance(o, d)).max(axis=1)
    assert np.median(error) < 1e-6 and (error > 1e-2).mean() < 5e-3


def test_the_closed_form_tracer_obeys_physical_laws():
    """Independent of the tracer: Brewster's angle, Beer–Lambert, a shadow's edge, an invisible ball."""
    brewster = np.cos(np.arctan(1.5))
    s = ((1 - 1.5**2) / (1 + 1.5**2)) ** 2  # all that is reflected there is perpendicular
    assert reflectance(np.array([brewster]), 1 / 1.5)[0] == pytest.approx(s / 2)
    assert reflectance(np.array([np.cos(np.arcsin(1 / 1.5)) - 1e-6]), 1.5)[0] == 1
    glass = Ball(
        "g", (0, 0, 10), 2, Material(colour=(0, 0, 0), transmission=(1, 1, 1), absorption_per_mm=(0.1, 0, 1))
    )
    sky = still_life().background
    through = World((glass,), background=sky, max_depth=2).radiance(np.zeros((1, 3)), np.array([[0, 0, 1.0]]))[0]
    clear = np.array(sky.horizon)
    expected = clear * (0.04 + 0.96**2 * np.exp([-0.4, 0, -4]))
    np.testing.assert_allclose(through, expected, rtol=1e-12)
    floor = Floor("f", (0, 0, 0), (9, 9), Material(colour=(1, 1, 1)))
    above = Ball("b", (0, 5, 0), 1, Material())
    shaded = World((floor, above), (Light(kind="directional", vector=(0, -1, 0), colour=(1, 1, 1)),))
    x = np.array([0.0, 0.99, 1.01, 4.0])
    seen = shaded.radiance(np.column_stack([x, np.ones(4), 0 * x]), np.tile([0, -1.0, 0], (4, 1)))[:, 0]
    np.testing.assert_allclose(seen, [0, 0, 1, 1], atol=1e-12)


# -- comparison with POV-Ray: scene description, and a message where POV-Ray is not installed


def test_without_povray_the_script_prints_a_message_and_exits_0(monkeypatch, capsys):
    monkeypatch.setattr(povray.shutil, "which", lambda name: None)
    monkeypatch.setattr("sys.argv", ["povray"])
    with pytest.raises(SystemExit) as stop:
        povray.main()
    assert stop.value.code == 0 and "povray is not installed" in capsys.readouterr().out


def test_triangles_stand_for_rays_by_centroid_and_normal():
    L, D = preset("setup1", scale=32).rays(rows=slice(0, 3), cols=slice(0, 5))
    o, d = L.reshape(-1, 3), D.reshape(-1, 3) / np.linalg.norm(D.reshape(-1, 3), axis=1, keepdims=True)
    text = povray.mesh_camera(o, d)
    numbers = [
        float(x) for x in re.findall(r"[-+.\de]+(?=[,>])", text[text.index("triangle") : text.rindex("location")])
    ]
    corners = np.array(numbers).reshape(-1, 3, 3)
    np.testing.assert_allclose(corners.mean(axis=1), o, atol=1e-12)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # POV-Ray's frame is left-handed, as ours is, and its triangles look against the product of their sides
    np.testing.assert_allclose(-normal / np.linalg.norm(normal, axis=1, keepdims=True), d, atol=1e-12)


def test_every_solid_and_light_of_the_world_is_described():
    world = still_life()
    lines = povray.described(world)
    starts = [line.split(" ")[0] for line in lines]
    assert sorted(starts) == ["box", "light_source", "light_source", "sky_sphere", "sphere", "sphere", "sphere"]
    assert any("ior 1.5" in line for line in lines) and any("roughness 0.025" in line for line in lines)


def test_the_page_states_16_bit_agreement_as_measured():
    """On b1dc540 the page said it of "the matt ball"; it holds for POV-Ray and the closed form alone."""
    rounding = 20 * np.log10(65535 * np.sqrt(12))  # PSNR of values rounded to 16 bits, evenly spread errors
    found = {
        (one["camera"], row["seen"]): row
        for one in povray.RECORDS.rows(scale=povray.SCALE)
        for row in one["rows"]
        if one["rays by"] == "mesh_camera"
    }
    closed, ours = "POV-Ray / closed form, dB", "POV-Ray / ours, dB"
    for camera in ("pinhole", "setup1"):
        assert min(found[camera, "sky"][closed], found[camera, "sky"][ours]) > rounding - 1
    assert found["pinhole", "matt"][closed] > rounding - 1
    assert f"{found['pinhole', 'matt'][ours]:.1f}" == "47.4"
    assert {f"{found['setup1', 'matt'][pair]:.1f}" for pair in (closed, ours)} == {"63.6"}
    page = " ".join((povray.IMAGES.parent / "stability.md").read_text(encoding="utf-8").split())
    assert "triangles of our balls (384 segments) limit it to 47.4 dB" in page
    assert "limits the agreement of both to 63.6 dB" in page


# -- disparity errors of real main lenses: the ideal twin has none; the sign is positive beyond the plane in focus


@pytest.mark.parametrize("name", LENSES)
def test_the_twin_has_the_planes_and_the_magnification_of_the_lens_and_no_error(name):
    camera = real_camera(name)
    twin = ideal_twin(camera)
    # The field lens, 0.2 mm before the array, is not in the twin's closed form: 0.2/75 of a magnification.
    assert magnification(twin) == pytest.approx(magnification(camera), rel=5e-3)
    assert through_front_mm(twin, twin.gap_mm) == pytest.approx(through_front_mm(camera, camera.gap_mm), rel=1e-4)
    for field in (0.0, 6.0, 12.0):
        for axis in (0, 1):
            error, bend, share = slope(twin, field, axis)
            assert abs(error) < 1e-12 and bend < 1e-12 and share > 0.9


def test_disparity_of_planes_off_focus_has_one_sign_on_each_side():
    twin = ideal_twin(real_camera("triplet"))
    focus = through_front_mm(twin, twin.gap_mm)
    near, far = slope(twin, 0.0, 0, focus - 5)[0], slope(twin, 0.0, 0, focus + 5)[0]
    assert near < 0 < far and near == pytest.approx(-far, rel=0.01)
    # Closed form: the 16 views come from the opening, `width` wide, which stands `ahead` of the plane in focus.
    width, pitch = twin.front[1].diameter_mm, twin.lens_pitch_mm[0] * magnification(twin)
    assert far == pytest.approx(5 * width / 16 / (focus - twin.front[1].z_mm) / pitch, rel=0.01)
