"""Q_view by the model of display and eye, and measures against SIMULATED observers of that display.

    python -m benchmarks run eye_views --scales 4,2

Scenes, schemes and rates are those of Figure 5.19, through setup 3. Q_view takes one pixel through the middle of
every lens (4.3). Here its five views are also computed for an eye with a pupil, before an ideal display and before
one with faults, to see whether the order of schemes changes. The observers are simulated: their quality is Q_view
before the display with faults, and their answers pass through plan, files and analysis of a test. Third-party
measures (`view_measures`) are compared with ours by the same observers.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.accuracy.view_measures import CANDIDATES, available, candidates
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, number, origin
from benchmarks.study.coding import SCENES, shot
from benchmarks.study.views import LABELS, SHOWN
from codec import decode, encode
from ii_core import DisplayModel, Eye, IIPicture, eye_image, five_viewpoints
from ii_core.base.parallel import cores
from ii_core.picture.view import camera_of
from metrics import measuring
from metrics.measures.view import mssim
from metrics.observers import Options, Verdict, read_results, verdict
from metrics.observers.plan import make_plan
from metrics.observers.simulated import write_simulated
from metrics.plots.opinion_chart import opinion_chart

RECORDS = Records(
    "eye_views",
    (
        "benchmarks.accuracy.eye_views",
        "benchmarks.accuracy.view_measures",
        "benchmarks.study.coding",
        "benchmarks.study.views",
    ),
)
SCALES, RATES = (4, 2), (0.15, 0.3, 0.63, 1.0)
MEASURES = ("q_global", "q_angle_min", "q_view", "q_view_min", "q_view_psnr", "q_view_pooled_psnr")
PUPIL_MM = 4.0
FAULTS: dict[str, Any] = {"layout": "rgb-stripe", "fill": 0.6, "black": 0.005, "crosstalk": 0.1, "turn_deg": 0.05}
DISPLAYS: dict[str, dict[str, Any]] = {"ideal": {}, "faults": FAULTS}
TIE = 0.001  # schemes whose Q_view differs by less have no order
OBSERVERS, BIAS, SPREAD = 24, 0.3, 0.7


def main() -> None:
    """Measure, record, draw, fill the pages."""
    asked = command_line(__doc__, scenes=SCENES, scales=[str(scale) for scale in SCALES]).parse_args()
    keys = [{"scene": scene, "scale": int(scale)} for scale in asked.scales for scene in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: {"points": points(**key), "peers": available()})
    path = IMAGES / "opinions_simulated.png"
    opinion_chart(simulated(), path)
    write_picture(path, path)
    publish(tables())


def points(scene: str, scale: int) -> list[dict[str, Any]]:
    """Return measures, and Q_view before each display, of every scheme and rate."""
    picture = shot(scene, "setup3", scale).picture
    measure, others = measuring(picture, MEASURES), candidates(picture)
    references = {name: eye_views(picture, name) for name in DISPLAYS}

    def point(one: tuple[str, float]) -> dict[str, Any]:
        coded = encode(picture, one[0], bpp=one[1])
        decoded = decode(coded)
        seen = {name: q_eye(references[name], eye_views(decoded, name)) for name in DISPLAYS}
        head = {"scheme": one[0], "target_bpp": one[1], "bpp": coded.bpp, "reached": coded.reached}
        return {**head, **measure(decoded), **others(decoded), **seen}

    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(point, ((scheme, rate) for scheme in SHOWN for rate in RATES)))


def eye_views(picture: IIPicture, display: str) -> list[Any]:
    """Return the views of an eye of a display from the five viewpoints."""
    camera = camera_of(picture)
    model = DisplayModel(camera=camera, **DISPLAYS[display])
    places: Any = five_viewpoints(camera).values()
    return [eye_image(picture, model, Eye(position_mm=tuple(p), pupil_mm=PUPIL_MM)).pixels for p in places]


def q_eye(reference: list[Any], decoded: list[Any]) -> float:
    """Mean MSSIM of views."""
    everywhere = np.ones(reference[0].shape[:2], bool)
    return float(np.mean([mssim(a, b, everywhere) for a, b in zip(reference, decoded, strict=True)]))


def rows() -> list[dict[str, Any]]:
    """Return all points at rates that the scheme reaches, with scene, scale and commit."""
    names = ("scene", "scale", "commit")
    found = [{**point, **{name: row[name] for name in names}} for row in RECORDS.rows() for point in row["points"]]
    return [point for point in found if point["reached"]]


def finest() -> list[dict[str, Any]]:
    """Return the points of the finest scale at which every scene is measured."""
    found = rows()
    scenes = {one["scene"] for one in found}
    whole = [s for s in {one["scale"] for one in found} if {o["scene"] for o in found if o["scale"] == s} == scenes]
    return [one for one in found if one["scale"] == min(whole)]


def tables() -> Tables:
    """Return the tables of the order of schemes before displays, and of the prediction of simulated observers."""
    return {("docs/display.md", "eye-order"): order_table(), ("docs/observers.md", "simulated"): simulated_table()}


def order_table() -> list[str]:
    """Pairs of schemes whose order is that of Q_view, by scene, over all rates that both reach."""
    if not (found := rows()):
        return []
    lines = [
        "| scale | scene | pairs | order kept, ideal display | with faults | reversed by more than 0.01 |",
        "|---|---|---|---|---|---|",
    ]
    for scale in sorted({one["scale"] for one in found}, reverse=True):
        at = [one for one in found if one["scale"] == scale]
        counts = {scene: kept_pairs([one for one in at if one["scene"] == scene]) for scene in SCENES}
        counts = {scene: each for scene, each in counts.items() if each.any()}
        if len(counts) > 1:
            counts["all"] = np.sum(list(counts.values()), axis=0)
        lines += [f"| {scale} | {scene} | " + " | ".join(map(str, each)) + " |" for scene, each in counts.items()]
    return [*lines, "", origin(found)]


def kept_pairs(found: list[dict[str, Any]]) -> Any:
    """Return pairs with an order, pairs that keep it before each display, and pairs that are clearly reversed."""
    counts = np.zeros(4, int)
    for a, b in combinations(found, 2):
        apart = a["q_view"] - b["q_view"]
        if a["target_bpp"] != b["target_bpp"] or abs(apart) < TIE:
            continue
        kept = [apart * (a[name] - b[name]) > 0 for name in DISPLAYS]
        clear = any(-np.sign(apart) * (a[name] - b[name]) > 0.01 for name in DISPLAYS)
        counts += [1, *kept, clear]
    return counts


def simulated() -> Verdict:
    """Return the verdict of SIMULATED observers; quality is Q_view before the display with faults, scaled to 1–5."""
    found = finest()
    low, high = (f([number(one["faults"]) for one in found]) for f in (min, max))
    stimuli: list[dict[str, Any]] = []
    quality: list[float] = []
    for scene in dict.fromkeys(one["scene"] for one in found):
        stimuli.append({"scene": scene, "name": "reference", "reference": True, "scheme": "", "measures": {}})
        quality.append(5.0)
        for one in (one for one in found if one["scene"] == scene):
            label = LABELS[1 + SHOWN.index(one["scheme"])]
            name = f"{label}, {one['target_bpp']:g} bpp"
            kept = {name: number(one[name]) for name in measured(found)}
            stimuli.append({"scene": scene, "name": name, "reference": False, "scheme": label, "measures": kept})
            quality.append(1 + 4 * (number(one["faults"]) - low) / (high - low))
    plan = make_plan(stimuli, [5 - one for one in quality], Options(observers=OBSERVERS))
    with tempfile.TemporaryDirectory() as folder:
        files = write_simulated(folder, plan, quality, OBSERVERS, bias=BIAS, spread=SPREAD)
        return verdict(read_results(files))


def measured(found: list[dict[str, Any]]) -> list[str]:
    """Return our measures, and the third-party measures that every point has."""
    return [*MEASURES, *(name for name in CANDIDATES if all(name in one for one in found))]


def simulated_table() -> list[str]:
    """PLCC, SROCC, RMSE and outlier ratio of each measure for all stimuli; PLCC by scene and by scheme."""
    if not rows():
        return []
    found = finest()
    made = simulated()
    groups = [group for group in dict.fromkeys(group for _, group in made.predictions) if group != "all"]
    lines = [
        f"| measure | PLCC | SROCC | RMSE | outliers | {' | '.join(groups)} |",
        "|---|" + "---|" * (4 + len(groups)),
    ]
    for measure in measured(found):
        every = made.predictions[measure, "all"]
        each = " | ".join(f"{made.predictions[measure, group].plcc:.2f}" for group in groups)
        head = f"{every.plcc:.3f} | {every.srocc:.3f} | {every.rmse:.2f} | {every.outlier_ratio:.0%}"
        lines.append(f"| `{measure}` | {head} | {each} |")
    return [*lines, "", origin(found)]
