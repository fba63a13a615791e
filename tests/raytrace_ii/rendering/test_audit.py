"""Audit of pictures: against whole pictures in full, for any tiles and workers."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from ii_core import preset, read_maps, write_maps
from metrics import q_global
from raytrace_ii import Audit, render, render_to
from raytrace_ii.rendering import audit, job
from raytrace_ii.sampling.samples import Adaptive
from tests.support.trace_scenes import hall

CAMERA = preset("setup1", scale=128)  # 64×32 px, 4×2 lenses
SAMPLES = 32  # in full: as many as 256 where the number itself does not matter, and faster
FULL = {"samples": SAMPLES, "seed": 4, "support": ()}


@pytest.fixture(autouse=True)
def fewer(monkeypatch):
    monkeypatch.setattr(job, "FULL_SAMPLES", SAMPLES)


@pytest.fixture(scope="module")
def scene():
    return hall().with_depth(audit.FULL_DEPTH)


@pytest.fixture(scope="module")
def full(scene):
    return render(scene, CAMERA, **FULL).picture


def differences(picture, full):
    return np.abs(picture.pixels.astype(int) - full.pixels.astype(int)).max(axis=2)


def test_in_full_means_at_least_256_samples_12_bounces_and_filtered_textures(scene, monkeypatch):
    monkeypatch.undo()
    for sampling, samples in ((1, 256), (Adaptive(4, 16, 0.5), 256), (Adaptive(4, 1024, 0.5), 1024), (300, 300)):
        few = job.Job(scene.with_depth(2), CAMERA, sampling, 3, np.eye(4), "uint16", (), texture_filter=False)
        full = few.in_full()
        assert (full.sampling, full.scene.max_depth, full.texture_filter, full.seed) == (samples, 12, True, 3)
    assert job.Job(scene.with_depth(20), CAMERA, 1, 3, np.eye(4), "uint16", ()).in_full().scene.max_depth == 20


@pytest.mark.parametrize("samples", [1, (4, 16)])
def test_all_pixels_audited_give_the_differences_of_whole_pictures(scene, full, samples):
    shot = render(scene, CAMERA, samples=samples, seed=4, audit=1, support=())
    off, found = differences(shot.picture, full), shot.stats.audit
    assert found.pixels == off.size and found.worst == off.max() > audit.WRONG_CODES
    assert found.wrong == (off > audit.WRONG_CODES).sum() > 0
    assert found.psnr_db == pytest.approx(q_global(full, shot.picture), abs=1e-9), "rounding of sums"


def test_the_picture_in_full_has_no_wrong_pixel_and_an_introduced_error_is_found(scene, full, monkeypatch):
    exact = render(scene, CAMERA, **FULL, audit=0.2).stats.audit
    assert (exact.wrong, exact.worst, exact.psnr_db) == (0, 0.0, math.inf) and exact.pixels > 300
    right = job.Job._fixed

    def dark(self, tracer, samples, rows, cols, order, support):
        radiance = right(self, tracer, samples, rows, cols, order, support)
        radiance[(cols.start + order.columns) % 16 == 3] *= 0.5
        return radiance

    monkeypatch.setattr(job.Job, "_fixed", dark)
    wrong = render(scene, CAMERA, **FULL, audit=0.2)
    m, n = audit.chosen(4, 0.2, 64, slice(32), slice(64))
    off = differences(wrong.picture, full)[n, m]
    assert wrong.stats.audit.wrong == (off > audit.WRONG_CODES).sum() > 0
    assert wrong.stats.audit.worst == off.max()


def test_same_result_for_any_workers_tiles_and_files(scene, tmp_path, monkeypatch):
    options = {"samples": 2, "seed": 7, "audit": 0.03}
    one = render(scene, CAMERA, workers=1, **options)
    plain = render(scene, CAMERA, samples=2, seed=7)
    np.testing.assert_array_equal(one.picture.pixels, plain.picture.pixels)
    assert plain.stats.audit is None and one.stats.rays == plain.stats.rays, "off unless asked for, and not counted"
    assert render_to(tmp_path / "p.png", scene, CAMERA, noise=3.0, **options).audit == one.stats.audit
    monkeypatch.setattr(job, "TILE_RAYS", 512)
    for workers in (1, 3):
        again = render(scene, CAMERA, workers=workers, **options).stats.audit
        assert (again.pixels, again.wrong, again.worst) == (
            one.stats.audit.pixels, one.stats.audit.wrong, one.stats.audit.worst
        )  # fmt: skip
        assert again.squares == pytest.approx(one.stats.audit.squares, rel=1e-12), "sums of other tiles"
    assert again == render(scene, CAMERA, workers=1, **options).stats.audit


def test_in_another_process(scene):
    task = job.Job(scene, CAMERA, 1, 3, np.eye(4), "uint16", (), audit=0.05)
    tile = task.tiles()[0]
    found = pickle.loads(pickle.dumps(task)).tile(*tile).audit
    assert found == task.tile(*tile).audit and found.pixels > 0


def test_stored_maps_are_audited_with_all_their_samples(scene, tmp_path):
    write_maps(
        [CAMERA], tmp_path / "maps", format="exr", samples=[((0.25, 0.5), (0.5, 0.5)), ((0.75, 0.5), (0.5, 0.5))]
    )
    (maps,) = read_maps(tmp_path / "maps")
    exact = render(scene, maps, audit=1, support=())
    assert exact.stats.audit == Audit(pixels=64 * 32), "no difference"
    shallow = render(scene.with_depth(0), maps, audit=1, support=())
    off = differences(shallow.picture, exact.picture)
    assert shallow.stats.audit.wrong == (off > audit.WRONG_CODES).sum() > 0


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_differences_are_in_8_bit_codes_for_every_type(scene, dtype):
    """White light is 255 codes whatever its code; the error of 8-bit rounding is at most half a code."""
    eight, other = (
        render(scene, CAMERA, seed=4, audit=0.3, dtype=kind, support=()).stats.audit for kind in ("uint8", dtype)
    )
    assert other.pixels == eight.pixels
    assert abs(other.worst - eight.worst) <= 1
    np.testing.assert_allclose(audit.codes(np.ones(3, np.float32)), 255)


def test_the_seed_selects_the_share_of_pixels():
    m, n = audit.chosen(5, 0.01, 1000, slice(0, 400), slice(0, 1000))
    assert abs(len(m) - 4000) < 4 * 63, "four standard deviations"
    parts = [audit.chosen(5, 0.01, 1000, slice(0, 400), cols) for cols in (slice(0, 333), slice(333, 1000))]
    whole = set(zip(m.tolist(), n.tolist(), strict=True))
    assert whole == {pixel for part in parts for pixel in zip(*(a.tolist() for a in part), strict=True)}
    other = audit.chosen(6, 0.01, 1000, slice(0, 400), slice(0, 1000))
    assert len(whole & set(zip(*(a.tolist() for a in other), strict=True))) < 100, "another seed, other pixels"
    assert len(audit.chosen(5, 1.0, 8, slice(0, 4), slice(0, 8))[0]) == 32


def test_result_in_words():
    assert replace(Audit(), pixels=4, wrong=1, worst=9, squares=12).about == (
        "measured at 4 pixels: 1 wrong by more than 2 codes, 48.1 dB, worst 9.0 codes"
    )
    assert math.isnan(Audit().psnr_db) and Audit().about == "no pixel audited: a larger share is needed"


@pytest.mark.parametrize("value", [-0.1, 1.5, math.nan])
def test_shares_out_of_range_are_refused(scene, value):
    with pytest.raises(ValueError, match=r"audit is .*: a share of the pixels, from 0 to 1, is needed"):
        render(scene, CAMERA, audit=value)
