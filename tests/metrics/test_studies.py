"""Rate–distortion studies of any measure: tables, charts, Q_depth over rate."""

import csv
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from ii_core import IICamera, IIPicture
from ii_core.base.files import read_image, write_image
from metrics import (
    MEASURES,
    Measure,
    depth_over_rate,
    depth_rate_chart,
    linear_layers,
    measuring,
    q_angle,
    q_angle_ycbcr,
    q_depth,
    q_view,
    rate_distortion,
    rd_chart,
    read_study,
    register_measure,
    report,
    summary_table,
    write_csv,
    write_latex,
    write_study,
)
from metrics.plots.depth_chart import draw_depth_rate
from metrics.plots.rd_chart import draw
from metrics.plots.tables import latex_text

SCHEMES, RATES = ["fine", "coarse"], [3, 6, 9, 12, 15, 24]


def picture(lenses=(14, 12)):
    camera = IICamera(pixels=(lenses[0] * 4, lenses[1] * 4), lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1.5)
    y, x = np.mgrid[0 : lenses[1] * 4, 0 : lenses[0] * 4]
    shade = 128 + 90 * np.sin(x / 5) * np.cos(y / 4)
    pixels = np.stack([shade, 255 - shade, shade / 2], axis=-1).astype(np.uint8)
    return IIPicture(pixels, lenses, (4, 4), camera)


def encode(source, scheme, *, bpp):
    """Keep as many bits of each value as the rate allows; if coarse, one bit less in the far right half."""
    bits = min(8, max(1, int(bpp / 3)))
    step = np.full(source.pixels.shape[1], 2 ** (8 - bits))
    if scheme == "coarse":
        step[source.pixels.shape[1] // 2 :] *= 2 if bits < 8 else 1
    coded = source.pixels // step[:, None] * step[:, None] + step[:, None] // 2
    return SimpleNamespace(
        bpp=3.0 * bits, nbytes=1, encode_seconds=0.1, reached=True, picture=source.with_pixels(coded.astype(np.uint8))
    )


def truth(a):
    depth = np.full(a.pixels.shape[:2], 15.0)
    depth[:, a.pixels.shape[1] // 2 :] = 60.0
    return depth


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    a = picture()
    names = [name for name in MEASURES if name != "q_ms_ssim"]
    records = rate_distortion(
        a, SCHEMES, RATES, encode=encode, decode=lambda c: c.picture, measure=measuring(a, names, depth=truth(a))
    )
    path = tmp_path_factory.mktemp("study") / "s.json"
    write_study(path, "waves", records, picture=a)
    return records, path


def test_records_hold_what_the_functions_give(study):
    a, (records, _) = picture(), study
    for record in records[::4]:
        b = encode(a, record["scheme"], bpp=record["target_bpp"]).picture
        angle, view, layers = q_angle(a, b), q_view(a, b), q_depth(a, b, depth=truth(a))
        assert (record["q_angle_mean"], record["q_angle_min"]) == (angle.mean, angle.worst)
        assert record["q_ycbcr"] == q_angle_ycbcr(a, b).mean
        assert (record["q_view"], record["q_view_min"]) == (view.mean, view.worst)
        assert (record["q_view_psnr"], record["q_view_pooled_psnr"]) == (view.mean_psnr, view.pooled_psnr)
        assert (record["q_depth_min"], record["q_depth_mean"]) == (layers.min, layers.mean)
        np.testing.assert_array_equal(record["q_depth"], layers.values)
        np.testing.assert_array_equal(record["depth_mm"], layers.depth_mm)
        assert record["depth_outside"] == layers.outside_share == 0


def test_the_file_keeps_infinite_and_missing_qualities_apart(study):
    records, path = study
    json.loads(path.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    for kept, record in zip(read_study(path)["points"], records, strict=True):
        assert kept.keys() == record.keys()
        np.testing.assert_array_equal(kept["q_depth"], record["q_depth"])  # NaN, inf and numbers
        assert all(kept[name] == record[name] for name in MEASURES if name in record)
    assert records[5]["q_depth_min"] == math.inf and np.isnan(records[5]["q_depth"]).sum() == 248


@pytest.mark.parametrize("measure", ["q_global", "q_view", "q_depth_min", "q_view_psnr", "q_ycbcr"])
def test_a_table_of_any_measure(study, measure):
    rows = summary_table(read_study(study[1]), anchor="coarse", measure=measure)
    db = MEASURES[measure].unit == "dB"
    assert list(rows[0])[-3:] == ["gain", "BD-rate", "BD-PSNR" if db else "BD-quality"]
    fine, coarse = rows
    assert coarse["gain"] == "anchor"
    records = {(r["scheme"], r["target_bpp"]): r[measure] for r in study[0]}
    assert fine["9"] == f"{records['fine', 9]:.{2 if db else 4}f}"
    both = [records["fine", rate] - records["coarse", rate] for rate in RATES]
    mean = np.mean([gain for gain in both if math.isfinite(gain)])
    assert fine["gain"].startswith(f"{mean:+.{2 if db else 4}f}{' dB' if db else ''} at ")
    assert float(fine["BD-rate"].removesuffix(" %")) < 0  # a bit less in the far half costs rate


def test_a_missing_measure_is_named(study):
    kept = read_study(study[1])
    for work in (summary_table, draw):
        with pytest.raises(ValueError, match="unknown measure 'q_nope': known are q_global"):
            work(kept, measure="q_nope")
        with pytest.raises(ValueError, match="the study has no q_ms_ssim: it has q_global, q_angle_mean"):
            work(kept, measure="q_ms_ssim")


def test_csv_has_a_column_a_measure(study, tmp_path):
    write_csv(tmp_path / "s.csv", study[0])
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["q_view"]) for row in rows] == [record["q_view"] for record in study[0]]
    assert "q_depth" not in rows[0] and "q_depth_mean" in rows[0] and float(rows[0]["depth_outside"]) == 0


def test_latex_equals_the_table(study, tmp_path):
    rows = summary_table(read_study(study[1]), anchor="coarse")
    write_latex(tmp_path / "t.tex", rows, "50 % of A_b & C")
    text = (tmp_path / "t.tex").read_text()
    assert text.isascii()  # any LaTeX takes it
    assert (
        r"\caption{50 \% of A\_b \& C}" in text and text.count(r" \\") == 3 and r"\begin{tabular}{lrrrrrrrrr}" in text
    )
    line = next(line for line in text.splitlines() if line.startswith("fine"))
    back = [cell.strip().replace("--", "–").replace(r"\%", "%") for cell in line.removesuffix(r" \\").split("&")]
    assert back == list(rows[0].values())
    special = '\\{}$&#^_~%<>|"–−×±°…'
    assert latex_text(special).isascii() and latex_text("a_b\\c") == r"a\_b\textbackslash{}c"
    with pytest.raises(ValueError, match="the same in all"):
        write_latex(tmp_path / "u.tex", [{"a": "1"}, {"b": "2"}])
    with pytest.raises(ValueError, match="the same in all"):
        write_latex(tmp_path / "u.tex", [])
    assert not (tmp_path / "u.tex").exists()


def test_q_depth_over_rate_is_what_was_measured(study):
    kept = read_study(study[1])
    rates, depth, values = depth_over_rate(kept, "coarse")
    assert rates.tolist() == RATES and depth.size == 250 and values.shape == (6, 250)
    layers = np.flatnonzero(~np.isnan(values[0]))
    np.testing.assert_allclose(depth[layers], [15, 60])
    assert (values[:5, layers[0]] > values[:5, layers[1]] + 3).all() and (values[5, layers] == np.inf).all()
    with pytest.raises(ValueError, match="no scheme 'x'"):
        depth_over_rate(kept, "x")
    bare = {**kept, "points": [{k: v for k, v in p.items() if k != "q_depth"} for p in kept["points"]]}
    with pytest.raises(ValueError, match="no q_depth in every layer"):
        depth_over_rate(bare, "fine")


def test_the_image_of_q_depth_lies_at_its_rates_and_depths(study):
    figure = draw_depth_rate(read_study(study[1]))
    image, lines = figure.axes[1], figure.axes[3]
    mesh = image.collections[0]
    at, shown = mesh.get_coordinates(), np.ma.filled(mesh.get_array(), np.nan)
    _, depth, values = depth_over_rate(read_study(study[1]), "coarse")
    for i, rate in enumerate(RATES[:5]):
        for z in (15.0, 60.0):
            column = np.searchsorted(at[0, :, 0], rate) - 1
            row = np.searchsorted(at[:, 0, 1], z) - 1
            assert column == i and shown[row, column] == values[i, np.flatnonzero(np.isclose(depth, z))[0]]
    assert image.get_xlim() == lines.get_xlim() and image.get_xscale() == "log"
    low, mean, high = (line.get_ydata()[:5] for line in lines.lines)
    assert (low < mean).all() and (mean < high).all()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_the_same_study_gives_the_same_file(study, tmp_path, suffix):
    kept = read_study(study[1])
    files = [tmp_path / f"{i}{suffix}" for i in range(3)]
    depth_rate_chart(kept, files[0])
    for path in files[1:]:
        rd_chart(kept, path, measure="q_view")
    contents = [path.read_bytes() for path in files]
    assert contents[0] != contents[1] == contents[2]
    if suffix == ".pdf":
        assert all(b"/TrueType" in c or b"/CIDFontType2" in c for c in contents)  # text that can be searched
    with pytest.raises(ValueError, match="no known chart type"):
        depth_rate_chart(kept, tmp_path / "x.bmp")


def test_inapplicable_measures_are_named_before_coding():
    a = picture()
    bare = IIPicture(a.pixels, a.lenses, a.ei_pixels)
    for names, said in (
        (["q_nope"], "unknown measure 'q_nope'"),
        (["q_view"], "no camera"),
        (["q_depth_min"], "no camera"),
        (["q_ms_ssim"], "at least 176×176 lenses, the picture has 14×12"),
    ):
        with pytest.raises(ValueError, match=said):
            measuring(bare, names)
    with pytest.raises(ValueError, match="q_view: needs at least 11×11 lenses, the picture has 6×6"):
        measuring(picture((6, 6)), ["q_view"])
    assert set(measuring(bare, ["q_ycbcr", "q_global"])(bare)) == {"q_ycbcr", "q_global"}


@pytest.mark.slow
def test_the_command_charts_all_measures(run, refused, tmp_path):
    a = picture((16, 16))
    a.save(tmp_path / "a.png")
    write_image(tmp_path / "z.exr", truth(a).astype(np.float32))
    command = ["study", tmp_path / "a.png", "--schemes", "si-h264,jpeg2000", "--rates", "0.5,2"]
    more = ["--measures", "q_view,q_depth", "--depth", tmp_path / "z.exr", "-o", tmp_path / "s"]
    code, out, _ = run(*command, *more)
    assert code == 0 and "mean of the five views' MSSIM" in out
    stems = ["q_view", "q_depth_min", "q_depth_mean", "q_depth_max"]
    expected = {f"a_{stem}{end}" for stem in stems for end in (".tex", ".png", ".pdf")}
    expected |= {"a_rd.json", "a_rd.csv", "a_q_depth.png", "a_q_depth.pdf"}
    assert {path.name for path in (tmp_path / "s").iterdir()} == expected
    assert read_image(tmp_path / "s" / "a_q_depth.png").shape[0] > 300
    refused(run(*command, *more), "is there already")
    # Layers that leave out the far half: the share is printed, kept and drawn.
    assert "0.0% of view pixels outside all layers" in out
    code, out, _ = run(*command, *more[:-1], tmp_path / "near", "--layers", "5:30:40")
    assert code == 0 and "50.0% of view pixels outside all layers" in out
    kept = read_study(tmp_path / "near" / "a_rd.json")
    assert {point["depth_outside"] for point in kept["points"]} == {0.5}
    assert len(kept["points"][0]["depth_mm"]) == 40
    assert draw_depth_rate(kept).get_suptitle() == "a: 50.0% of view pixels outside all layers"
    code, _, _ = run(
        *command, "--measures", "q_depth_mean", "--method", "robust", "--layers", "dissertation", "-o", tmp_path / "d"
    )
    kept = read_study(tmp_path / "d" / "a_rd.json")
    np.testing.assert_array_equal(kept["points"][0]["depth_mm"], linear_layers(a.camera))
    refused(
        run(*command, *more[:-1], tmp_path / "x", "--layers", "all"), "layers are 'all': dissertation, a number, NEAR"
    )
    refused(run(*command, "--measures", "q_best", "-o", tmp_path / "t"), "unknown measure 'q_best'")
    assert not (tmp_path / "t").exists()


def mean_absolute_error(pair):
    a, b = (picture.pixels.astype(float) for picture in pair.pictures)
    return np.abs(a - b).mean()


@pytest.fixture
def own_measure(monkeypatch):
    from metrics.measures import measure

    monkeypatch.setattr(measure, "MEASURES", MEASURES.copy())  # what a test registers ends with it
    return register_measure(
        Measure(name="q_mae", compute=mean_absolute_error, text="mean absolute error", higher_is_better=False)
    )


def test_an_own_measure_is_measured_reported_and_compared(own_measure, tmp_path):
    a = picture()
    measure = measuring(a, ["q_global", "q_mae"])
    records = rate_distortion(a, SCHEMES, RATES, encode=encode, decode=lambda c: c.picture, measure=measure)
    b = encode(a, "coarse", bpp=6).picture
    assert next(r for r in records if (r["scheme"], r["target_bpp"]) == ("coarse", 6))["q_mae"] == measure(b)["q_mae"]
    made = report(a, b)
    assert made.numbers["q_mae"] == measure(b)["q_mae"] and made.rows["q_mae"].endswith(
        ", mean absolute error, lower is better"
    )
    write_study(tmp_path / "s.json", "waves", records, picture=a)
    kept = read_study(tmp_path / "s.json")
    fine, coarse = summary_table(kept, anchor="coarse", measure="q_mae")
    assert float(fine["BD-rate"].removesuffix(" %")) < 0 and coarse["gain"] == "anchor"  # less error at equal rate
    assert draw(kept, "q_mae").axes[0].get_ylabel() == "q_mae, lower is better"


def test_records_of_a_measure_that_is_not_registered(study):
    # The older test of this fault never drew: its lambda called summary_table twice. Records with a measure from
    # another installation were called "without" it.
    kept = read_study(study[1])
    kept["points"] = [{**point, "q_mae": 1.0} for point in kept["points"]]
    for work in (summary_table, draw):
        with pytest.raises(ValueError, match=r"^unknown measure 'q_mae': known are q_global"):
            work(kept, measure="q_mae")
    rd = [name for name in kept["points"][0] if name in MEASURES]
    assert rd and "q_mae" not in rd


def test_names_of_measures_are_checked(own_measure):
    with pytest.raises(ValueError, match="'q_mae' is taken"):
        register_measure(Measure(name="q_mae", compute=len, text="another"))
    with pytest.raises(ValueError, match="measure name is 'a b'"):
        register_measure(Measure(name="a b", compute=len, text="another"))
    with pytest.raises(TypeError, match="measure is a str"):
        register_measure("q_mae")


def test_measures_of_installed_packages(monkeypatch):
    """An entry point adds its measure, or a list of them; one that does not load is left out with a warning."""
    from importlib.metadata import EntryPoint

    from ii_core.base import plugins
    from metrics.measures import measure

    monkeypatch.setattr(measure, "MEASURES", MEASURES.copy())
    points = [
        EntryPoint("broken", "no_such_module:x", "raytrace_ii.measures"),
        EntryPoint("own", f"{__name__}:PLUGIN", "raytrace_ii.measures"),
        EntryPoint("two", f"{__name__}:TWO_PLUGINS", "raytrace_ii.measures"),
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point for point in points if point.group == group])
    measure._load_plugins.cache_clear()
    try:
        with pytest.warns(UserWarning, match=r"measure plugin broken \(no_such_module:x\) is not loaded"):
            known = measure.known_measures()
        assert known["q_plugin"].text == "from a package"
        assert {"q_first", "q_second"} <= set(known)
    finally:
        measure._load_plugins.cache_clear()


PLUGIN = Measure(name="q_plugin", compute=mean_absolute_error, text="from a package")
TWO_PLUGINS = [
    Measure(name=name, compute=mean_absolute_error, text="from a package") for name in ("q_first", "q_second")
]
