"""Order of convergence of meshes, against the closed-form ray tracer."""

import numpy as np
import pytest

from benchmarks.accuracy import convergence
from benchmarks.accuracy.analytic import Ball, Floor, World, reflectance, still_life
from ii_core import preset
from raytrace_ii import Light, Material, trace

LEVELS = [24, 48, 96, 192]


@pytest.fixture(scope="module")
def rows():
    return convergence.balls(LEVELS, preset("setup1", scale=32))


# Three halvings, sampled at pixels: fitted orders were within 0.05 of theory for geometry, within 0.25 for light.
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
