"""Tests with observers: plan, results, verdict and their commands. On b1dc540 there is none of it."""

import io
import json
import threading
import urllib.error
import urllib.request
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from codec import encode
from ii_core import IIPicture, preset
from ii_core.base.files import read_image
from metrics.observers import Options, Stimulus, read_results, verdict, write_test
from metrics.observers.page import plates
from metrics.observers.plan import GRADES, duration_s, frame_order, frames_per_second, make_plan
from metrics.observers.plates import CONES, KINDS, colours
from metrics.observers.results import sealed
from metrics.observers.simulated import write_simulated
from metrics.observers.store import ResultFolder
from raytrace_ii.cli.server import Answers, PageServer
from tests.support import browser as browsers

SCENES = {"apples": 5, "car": 3, "cuboid": 4}


def entries(scenes=SCENES):
    """Stimuli as a plan keeps them: one reference and coded pictures of two schemes for each scene."""
    made = []
    for scene, count in scenes.items():
        for i in range(count + 1):
            scheme = "" if i == 0 else ("si-h264", "jpeg2000")[i % 2]
            measures = {} if i == 0 else {"q_global": 20.0 + 2 * i + len(scene), "upside_down": -float(i)}
            name = "reference" if i == 0 else f"{scheme} {i}"
            made.append({"scene": scene, "name": name, "reference": i == 0, "scheme": scheme, "measures": measures})
    return made


def planned(scenes=SCENES, **options):
    stimuli = entries(scenes)
    return make_plan(stimuli, [float(i) for i in range(len(stimuli))], Options(**options), plates=[1])


@pytest.fixture
def files(tmp_path):
    """Five simulated observers of the three scenes."""
    return write_simulated(tmp_path, planned(), np.linspace(1.5, 4.5, 15), 5, seed=1)


# The plan


@pytest.mark.parametrize("method", ["dsis", "pairs"])
def test_every_order_has_every_presentation_and_no_scene_twice_in_a_row(method):
    plan = planned(method=method, observers=8)
    scene = [one["scene"] for one in plan["stimuli"]]
    wanted = {
        "dsis": {(a, b) for a in (0, 6, 10) for b in range(15) if scene[a] == scene[b]},
        "pairs": {(a, b) for a in range(15) for b in range(a + 1, 15) if scene[a] == scene[b]},
    }[method]
    for order in plan["orders"]:
        seen = [tuple(pair) if method == "dsis" else tuple(sorted(pair)) for pair in order]
        assert len(seen) == len(wanted) and set(seen) == wanted
        # pairs of apples are 15 of 31: possible, as every other one; a careless draw ends with two of them
        assert all(scene[a] != scene[c] for (a, _), (c, _) in pairwise(order))
    assert len({json.dumps(order) for order in plan["orders"]}) == 8


def test_places_and_sides_are_balanced_over_every_two_observers():
    plan = planned(method="pairs")
    for first, second in zip(plan["orders"][::2], plan["orders"][1::2], strict=True):
        assert second == [pair[::-1] for pair in first[::-1]]
    left = sum(pair[0] < pair[1] for pair in plan["orders"][0])
    assert 0 < left < len(plan["orders"][0])  # sides are drawn, not always the better one on the left
    assert planned(method="dsis")["orders"][1] == planned(method="dsis")["orders"][0][::-1]


def test_the_seed_makes_the_order():
    assert planned(seed=4) == planned(seed=4) != planned(seed=5)


def test_training_shows_the_best_the_worst_and_the_middle_of_the_first_scene():
    assert planned()["training"] == [(0, 1), (0, 5), (0, 3)]
    assert planned(training=0)["training"] == []


def test_duration_and_paths():
    """17 presentations of 10 s, 3 s and 10 s, and 3 s for the answer."""
    assert duration_s(planned({"apples": 13})) == 17 * 26
    assert frame_order("across", 5) == (5, [0, 1, 2, 3, 4, 3, 2, 1])
    assert frame_order("around", 4) == (4, [0, 1, 2, 3]) and frame_order("front", 9) == (1, [0])
    assert frames_per_second("views", 5, 10.0) == 0.5 and frames_per_second("around", 24, 10.0) == 6.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"method": "acr"}, "unknown method 'acr': known are dsis, pairs"),
        ({"show": "film"}, "known are front, views, across, around"),
        ({"seconds": 0.0}, "seconds is 0"),
        ({"seconds": float("nan")}, "seconds is nan"),
        ({"grey_seconds": -1.0}, "grey_seconds is -1"),
        ({"frames": 1}, "frames is 1"),
        ({"observers": 3}, "an even number"),
        ({"block": 0}, "block is 0"),
        ({"training": 21}, "training is 21"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_options_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        Options(**change)


def test_too_many_presentations_are_refused():
    with pytest.raises(ValueError, match="at most 1000"):
        planned({"apples": 50}, method="pairs")
    with pytest.raises(ValueError, match="1 references and 0 coded"):
        planned({"apples": 0})


# The plates


def test_figure_and_ground_differ_in_one_cone():
    """An observer without that cone sees one colour: the other cones' signals are equal to 1e-12."""
    for cone, kind in enumerate(("protan", "deutan")):
        figure, ground = (CONES @ light for light in colours(kind))
        for other in range(3):
            ratio = figure[other] / ground[other]
            assert (abs(ratio - 1) > 0.1) if other == cone else ratio == pytest.approx(1, abs=1e-12)
        assert min(light.min() for light in colours(kind)) > 0 and max(light.max() for light in colours(kind)) < 1


def test_plates_show_their_digits_to_those_who_see_all_colours():
    made = plates(3)
    assert len({plate.digit for plate in made}) == len(KINDS)
    for plate, kind in zip(made, KINDS, strict=True):
        pixels = np.asarray(Image.open(io.BytesIO(plate.png))).astype(float)
        dots = np.abs(pixels - 128).max(axis=2) > 20
        # the ratio of red to green separates figure and ground, brightness does not
        ratio = pixels[..., 0][dots] / pixels[..., 1][dots]
        low, high = np.quantile(ratio, [0.05, 0.95])
        assert (high / low > 1.3) == (kind != "control") and 0.3 < dots.mean() < 0.75


# The results


def test_results_are_read(files):
    results = read_results(files)
    assert [one.number for one in results.observers] == [1, 2, 3, 4, 5] and results.notes == []
    assert all(len(one.answers) == 15 and one.complete and one.colours for one in results.observers)


def test_an_observer_who_stopped_half_way_counts(files):
    lines = files[2].read_text().splitlines(keepends=True)
    files[2].write_text("".join(lines[: 1 + 3 + 6]) + lines[10][:50])  # the last line was not finished
    results = read_results(files)
    assert results.notes == [f"{files[2]}: stopped after 6 of 15 answers, which count"]
    assert len(results.observers[2].answers) == 6


def rewritten(path, edit):
    path.write_text("".join(edit(path.read_text().splitlines(keepends=True))))


def resealed(edit):
    """Change records and renew the seals of all lines."""

    def change(lines):
        records = [json.loads(line) for line in lines]
        for record in records:
            del record["check"]
        made = [sealed(edit(records)[0])]
        for record in records[1:]:
            made.append(sealed(record, made[-1]))
        return made

    return change


def turned(line):
    """Change the first digit of a line's SHA-256, and nothing else."""
    at = line.index('"check":"') + len('"check":"')
    return line[:at] + format(15 - int(line[at], 16), "x") + line[at + 1 :]


def put(line, **change):
    return resealed(lambda records: [records[line].update(change), records][1])


def fractional(records):
    """Number the stimuli by floats: they led to an accidental IndexError."""
    plan = json.loads(records[0]["plan"])
    plan["orders"] = [[[float(n) for n in pair] for pair in order] for order in plan["orders"]]
    records[0]["plan"] = json.dumps(plan)
    return records


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda lines: [], "is empty: nobody answered"),
        (lambda lines: [lines[0][:100]], "is empty: nobody answered"),
        (lambda lines: [line.replace('"answer": 4', '"answer": 5') for line in lines], "was changed"),
        (lambda lines: lines[:5] + lines[6:], "line 6 was changed, or a line before it removed"),
        (lambda lines: [*lines[:5], lines[4], *lines[5:]], "line 6 was changed"),
        (lambda lines: ['{"kind": "begin"}\n', *lines[1:]], "line 1 has no seal"),
        (lambda lines: [*lines[:5], turned(lines[5]), *lines[6:]], "line 6 was changed"),
        (lambda lines: [*lines[:-1], turned(lines[-1])], "line 20 was changed"),
        (lambda lines: [*lines[:5], lines[5].replace('"check":"', '"check":"0'), *lines[6:]], "line 6 has no seal"),
        (lambda lines: [line.replace('"at": "2000', '"at": "2001') for line in lines], "line 1 was changed"),
        (put(6, answer=6), "answer 6: 6 is no answer of this test"),
        (put(6, answer=True), "answer 6: True is no answer"),
        (put(6, answer="left"), "'left' is no answer"),
        (put(6, pair=[0, 99]), "answer 6: not what observer 3 was shown there"),
        (put(6, place=3), "answer 6: not what observer 3 was shown there"),
        (put(6, at="1999-12-31T00:00:00.000Z"), "before the line above it"),
        (put(6, at=7), "no record with its time"),
        (put(0, observer=4), "not what observer 4 was shown there"),
        (put(0, observer="me"), "no plan or number"),
        (put(0, plan="{}"), "no plan of a test"),
        (resealed(fractional), "no plan of a test"),
        (put(0, format="other"), "is no result of an observer"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_clear_line(files, edit, said):
    rewritten(files[2], edit)
    results = read_results(files)
    assert [one.number for one in results.observers] == [1, 2, 4, 5]
    (note,) = results.notes
    assert said in note and "observer-003.jsonl" in note and note.endswith(": left out") and "\n" not in note


STRANGE = (None, True, 7, 0.5, "a", "", [], [[]], [7], [[0]], [[0, 0]], [[[0]]], {}, {"": ""}, {"a": [[0, 0]]})
PARTS = [
    *((key,) for key in ("format", "version", "method", "stimuli", "training", "orders")),
    *(("stimuli", 1), ("orders", 0), ("orders", 0, 1), ("orders", 0, 1, 0), ("training", 0)),
    *(("stimuli", 1, key) for key in ("scene", "name", "scheme", "reference", "measures")),
    ("stimuli", 1, "measures", "q_view"),
]


@pytest.mark.parametrize("part", PARTS, ids=str)
def test_a_plan_of_any_kinds_is_read_or_refused_in_words(tmp_path, part):
    """An object for ``orders`` was a KeyError."""
    (source,) = write_simulated(tmp_path, planned(), [3.0] * 15, 1)
    whole = json.loads(source.read_text(encoding="utf-8").splitlines()[0])["plan"]
    refused = 0
    for strange in STRANGE:
        plan = json.loads(whole)
        at = plan
        for key in part[:-1]:
            at = at[key]
        at[part[-1]] = strange
        head = {"format": "ii-observer", "version": 1, "kind": "begin", "at": "2026", "observer": 1}
        source.write_text(sealed({**head, "plan": json.dumps(plan)}), encoding="utf-8")
        try:
            read_results([source])
        except ValueError as error:
            refused += 1
            assert "has no plan of a test that this version reads: " in str(error) and "\n" not in str(error)
    assert refused >= len(STRANGE) - 4


def test_of_two_files_of_one_observer_and_of_two_tests_the_first_counts(files, tmp_path):
    copy = tmp_path / "observer-001 (1).jsonl"
    copy.write_bytes(files[0].read_bytes())
    (tmp_path / "b").mkdir()
    other = write_simulated(tmp_path / "b", planned(seed=9), [3.0] * 15, 6)[5]
    results = read_results([*files, copy, other])
    assert len(results.observers) == 5 and len(results.notes) == 2
    assert "is of observer 1" in results.notes[0] and "is of another test" in results.notes[1]


def test_no_files_of_observers_are_refused(tmp_path):
    (tmp_path / "a.jsonl").write_text("")
    with pytest.raises(ValueError, match=r"a\.jsonl is empty: nobody answered"):
        read_results([tmp_path / "a.jsonl"])
    with pytest.raises(ValueError, match="no files"):
        read_results([])
    with pytest.raises(OSError, match="does not exist"):
        read_results([tmp_path / "b.jsonl"])


def test_results_on_a_server_are_append_only(tmp_path):
    plan = planned()
    (tmp_path / "s").mkdir()
    source = write_simulated(tmp_path / "s", plan, [3.0] * 15, 1)[0].read_bytes()
    lines = source.splitlines(keepends=True)
    folder = ResultFolder(tmp_path / "r", json.dumps(plan))
    number = folder.new_observer()
    folder.extend(number, b"".join(lines[:3]))
    folder.extend(number, source)
    folder.extend(number, b"".join(lines[:5]))  # came late
    assert folder.path(number).read_bytes() == source
    shorter = "".join(
        [first := sealed({**json.loads(lines[0]), "at": "1999"}), sealed({"at": "2000"}, first)]
    ).encode()
    for wrong in (shorter, source[:-1], b"", source.replace(b'"place": 4', b'"place": 5')):
        with pytest.raises(ValueError):
            folder.extend(number, wrong)
    assert folder.path(number).read_bytes() == source
    with pytest.raises(FileNotFoundError):
        folder.extend(7, source)
    assert folder.new_observer() == 2  # an observer who never answers: an empty file
    assert ResultFolder(tmp_path / "r", json.dumps(plan)).new_observer() == 3  # the server starts again
    with pytest.raises(ValueError, match="of another test"):
        ResultFolder(tmp_path / "r", json.dumps(planned(seed=2)))


@pytest.fixture
def served(tmp_path):
    """A server of results; its address."""
    folder = ResultFolder(tmp_path / "r", json.dumps(planned()))
    maker = Answers.into(folder)
    server = PageServer(("127.0.0.1", 0), lambda *args: maker(*args, directory=str(tmp_path)))
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def post(url, data=b"", **headers):
    headers = {"Content-Type": "application/json", **headers}
    try:
        with urllib.request.urlopen(urllib.request.Request(url, data, headers)) as reply:
            return reply.status, json.loads(reply.read())
    except urllib.error.HTTPError as error:
        with error:  # its socket
            return error.code, None


def test_the_server_takes_results_of_its_own_page_alone(served, tmp_path):
    assert post(f"{served}/results") == (200, {"observer": 1})
    source = write_simulated(tmp_path, planned(), [3.0] * 15, 1)[0].read_bytes()
    assert post(f"{served}/results/1", source) == (200, {})
    assert (tmp_path / "r" / "observer-001.jsonl").read_bytes() == source
    # what a page of another site can send, by a form or by a host name of its own
    assert post(f"{served}/results", **{"Content-Type": "text/plain"})[0] == 415
    assert post(f"{served}/results", Host="evil.example")[0] == 421
    assert post(f"{served}/results/1", source.replace(b"simulated", b"Simulated"))[0] == 409
    assert post(f"{served}/results/2", source)[0] == 404 and post(f"{served}/other", source)[0] == 404
    assert post(f"{served}/results/1", source, **{"Content-Length": str(1 << 40)})[0] == 413
    assert (tmp_path / "r" / "observer-001.jsonl").read_bytes() == source


# The verdict


def test_scores_of_simulated_observers_come_back(tmp_path):
    """Grades are rounded and end at 1 and 5: within that, and the interval, the quality that went in."""
    quality = np.linspace(1.8, 4.2, 15)
    files = write_simulated(tmp_path, planned(), quality, 24, bias=0.2, spread=0.7, seed=2)
    made = verdict(read_results(files))
    assert made.simulated and made.observers >= 22 and made.unit == "MOS of SIMULATED observers"
    off = np.array([one.score for one in made.judged]) - quality
    assert all(one.given == made.observers for one in made.judged)  # the screening may leave one out
    assert np.abs(off).max() < 0.45 and np.mean(np.abs(off) <= [one.half_width for one in made.judged]) > 0.8


def test_scale_of_simulated_pairs_comes_back(tmp_path):
    """In standard deviations of the noise by Thurstone's law, or 1.7 times that as log odds; nothing for a tie."""
    plan = planned({"apples": 6}, method="pairs")
    quality = np.array([3.0, 1.8, 2.2, 2.4, 2.6, 2.8, 3.3])
    made = verdict(read_results(write_simulated(tmp_path, plan, quality, 60, spread=1.0, seed=3)))
    score = np.array([one.score for one in made.judged])
    assert score[0] == 0 and made.judged[0].half_width == 0  # the reference
    np.testing.assert_allclose(score, 1.7 * (quality - 3.0), atol=0.45)
    assert made.unit.startswith("quality above the reference")


def test_a_scene_without_a_scale_is_one_line(tmp_path):
    plan = planned({"apples": 3, "car": 3}, method="pairs")
    quality = [5.0, 1.0, 1.1, 1.2, 3.0, 2.9, 3.1, 3.0]  # the reference of apples never loses
    made = verdict(read_results(write_simulated(tmp_path, plan, quality, 20, spread=0.3, seed=4)))
    assert {made.plan["stimuli"][one.stimulus]["scene"] for one in made.judged} == {"car"}
    (note,) = made.notes
    assert note.startswith("apples has no scale") and "0 reference" in note


def test_colour_blind_and_reversed_observers_are_left_out(tmp_path):
    plan = planned({"apples": 13, "car": 13})
    quality = np.tile([1.0, 5.0], 14)  # outliers on both sides alike, as the screening wants them
    files = write_simulated(tmp_path, plan, quality, 31, bias=0.1, spread=0.3, seed=5)
    rewritten(files[4], put(0, colour_vision="failed"))

    def upside_down(records):
        for record in records[1:-1]:
            record["answer"] = 6 - record["answer"]
        return records

    rewritten(files[7], resealed(upside_down))
    made = verdict(read_results(files))
    assert made.observers == 29
    assert made.notes == [
        "observer 5 did not read the plates of colours: left out",
        "observer 8 is left out by the screening of BT.500",
    ]


def test_measures_predict_by_scene_and_scheme(tmp_path):
    """One measure is the quality itself but for the scene; another is its opposite within every scene."""
    scenes = {"apples": 12, "car": 12}
    quality = np.tile([5.0, *np.linspace(1.5, 4.5, 12)], 2)
    made = verdict(read_results(write_simulated(tmp_path, planned(scenes), quality, 24, bias=0.1, spread=0.4)))
    assert {group for _, group in made.predictions} == {"all", "apples", "car", "si-h264", "jpeg2000"}
    for group in ("apples", "car", "all"):
        good, bad = (made.predictions[name, group] for name in ("q_global", "upside_down"))
        assert good.plcc > 0.97 and good.srocc > 0.95 and bad.srocc < -0.95 and bad.plcc > 0.9
    numbers = json.loads(json.dumps(made.numbers, allow_nan=False))
    assert numbers["simulated"] is True and len(numbers["predictions"]) == len(made.predictions)
    assert made.with_measure("q_global", "apples")[0][0] == 28.0  # of the first coded picture; references have none


def test_results_without_valid_observers_are_refused(tmp_path):
    files = write_simulated(tmp_path, planned(), [3.0] * 15, 2)
    for path in files:
        rewritten(path, put(0, colour_vision="failed"))
    with pytest.raises(ValueError, match="no observer is left"):
        verdict(read_results(files))


# The page's making, and the commands


def picture(seed=0, scale=32):
    camera = preset("setup1", scale=scale)
    pixels = np.random.default_rng(seed).integers(0, 256, (*camera.pixels[::-1], 3), np.uint8)
    return IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)


def test_invalid_stimuli_are_refused(tmp_path, monkeypatch):
    a = Stimulus(scene="s", name="reference", picture=picture(), reference=True)
    b = Stimulus(scene="s", name="b", picture=picture(1))
    path = tmp_path / "t.html"
    for stimuli, said in (
        ([], "there are no stimuli"),
        ([a], "0 coded pictures"),
        ([b], "0 references"),
        ([a, b, b], "two stimuli named 'b'"),
        ([a, Stimulus(scene="s", name="c", picture=picture(scale=16))], "structure"),
    ):
        with pytest.raises(ValueError, match=said):
            write_test(path, stimuli)
    monkeypatch.setattr("metrics.observers.page.MAX_EMBEDDED", 1000)
    with pytest.raises(ValueError, match="would be larger"):
        write_test(path, [a, b])
    assert list(tmp_path.iterdir()) == []


def test_the_page_is_one_file_with_nothing_from_elsewhere(tmp_path):
    a = Stimulus(scene="</script>", name="reference", picture=picture(), reference=True)
    b = Stimulus(scene="</script>", name="$b", picture=picture(1), measures={"q_global": float("inf"), "q_view": 0.5})
    plan = write_test(tmp_path / "t.html", [a, b], Options(show="views"), title="<b>")
    text = (tmp_path / "t.html").read_text()
    assert text.count("ii.frame(") == 10 and "http" not in text.replace("http-", "")
    assert text.count("</script>") == text.count('<script nonce="') and "<b>" not in text
    assert plan["stimuli"][1]["measures"] == {"q_view": 0.5} and plan["grades"] == list(GRADES)
    assert (plan["size"], plan["zoom"]) == ([16, 8], 56)


@pytest.fixture(scope="module")
def coded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("coded")
    original = picture(scale=16)
    original.save(folder / "a.png")
    for qp in (20, 30, 40, 44, 48):
        encode(original, "si-h264", qp=qp).save(folder / f"a{qp}.ii")
    return [folder / "a.png", *sorted(folder.glob("a??.ii"))]


@pytest.mark.slow
def test_the_commands_from_pictures_to_a_table(run, coded, tmp_path):
    code, out, err = run("subjective", *coded, "-o", tmp_path / "t.html", "--show", "front", "--training", "0")
    assert code == 0 and "6 presentations, about 3 minutes" in out, err
    plan = json.loads(json.loads(next(
        line.split("ii.start(")[1].rsplit(", false)")[0]
        for line in (tmp_path / "t.html").read_text().splitlines() if line.startswith("ii.start(")
    )))  # fmt: skip
    assert set(plan["stimuli"][1]["measures"]) == {"q_global", "q_angle_min", "q_view", "q_view_psnr"}
    (tmp_path / "r").mkdir()
    write_simulated(tmp_path / "r", plan, [5.0, 4.5, 3.6, 2.8, 2.0, 1.4], 16, seed=1)
    (tmp_path / "r" / "observer-017.jsonl").touch()
    code, out, err = run("opinions", tmp_path / "r", "--json", tmp_path / "o.json", "--chart", tmp_path / "o.png")
    assert code == 0, err
    assert "MOS of SIMULATED observers, 16 observers" in out and "observer-017.jsonl is empty" in out
    assert out.count("±") == 6 and "q_view, all" in out and read_image(tmp_path / "o.png").shape[1] > 500
    assert json.loads((tmp_path / "o.json").read_text())["stimuli"][0]["answers"] == 16


def test_the_command_serves_the_test_and_keeps_results(run, monkeypatch, coded, tmp_path):
    words = [
        "subjective",
        *coded[:2],
        "--show",
        "front",
        "--measures",
        "none",
        "--serve",
        "--results",
        tmp_path / "r",
    ]

    def visit(url):
        with urllib.request.urlopen(url) as page:
            assert b"ii.frame(1, 0," in page.read()
        assert post(f"{url}results") == (200, {"observer": 1})
        assert (tmp_path / "r" / "observer-001.jsonl").read_bytes() == b""

    code, out, err = browsers.served(monkeypatch, run, words, visit)
    assert code == 0 and "answers go to" in out.splitlines()[0], err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--method", "acr"], "unknown method"),
        (["--size", "big"], "two whole numbers"),
        (["--observers", "7"], "an even number"),
        (["--measures", "q_none"], "unknown measure"),
        (["--serve"], "one of --output and --serve"),
    ],
)
def test_invalid_options_are_refused(run, refused, coded, tmp_path, options, said):
    refused(run("subjective", *coded, *options, "-o", tmp_path / "t.html"), said)
    assert not (tmp_path / "t.html").exists()


def test_a_title_of_control_characters_is_refused(coded, tmp_path):
    """A NUL split the page in three: a ValueError about values to unpack."""
    picture = IIPicture.load(coded[0])
    stimuli = [Stimulus(scene="a", name=name, picture=picture, reference=name == "r") for name in ("r", "b")]
    for title in ("a\0b", "a\nb", "\x1b[31m"):
        with pytest.raises(ValueError, match="title is"):
            write_test(tmp_path / "t.html", stimuli, title=title)
    for wrong, said in (({"scene": 3}, "scene"), ({"picture": None}, "picture"), ({"bpp": "1"}, "bpp")):
        with pytest.raises(TypeError, match=said):
            Stimulus(**{"scene": "a", "name": "b", "picture": picture, **wrong})
    with pytest.raises(TypeError, match="q_global"):
        Stimulus(scene="a", name="b", picture=picture, measures={"q_global": "30"})


def test_the_commands_refuse_files(run, refused, coded, tmp_path):
    refused(run("subjective", *coded, "-o", tmp_path / "t.txt"), ".html is needed")
    refused(run("subjective", *coded[1:], "-o", tmp_path / "t.html"), "comes before any picture")
    refused(run("subjective", coded[0], "-o", tmp_path / "t.html"), "0 coded pictures")
    refused(run("opinions", tmp_path / "none.jsonl"), "does not exist")
    (tmp_path / "r").mkdir()
    refused(run("opinions", tmp_path / "r"), "holds no file of an observer")
    (tmp_path / "r" / "a.jsonl").touch()
    refused(run("opinions", tmp_path / "r"), "a.jsonl is empty: nobody answered")
    (tmp_path / "r" / "a.jsonl").unlink()
    (only,) = write_simulated(tmp_path / "r", planned(), [3.0] * 15, 1)
    rewritten(only, lambda lines: [*lines[:9], turned(lines[9]), *lines[10:]])
    refused(run("opinions", tmp_path / "r"), "observer-001.jsonl, line 10 was changed, or a line before it removed")
