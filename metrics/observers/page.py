"""Page of a test with observers: one self-contained HTML file."""

from __future__ import annotations

import base64
import html
import io
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ii_core.base import checks
from ii_core.base.checks import Pair, view_size
from ii_core.base.files import atomic_path
from ii_core.display.look import focused_view, viewpoints_across, viewpoints_around
from ii_core.display.policy import nonce_of, policy
from ii_core.picture.assumed import with_assumed_camera
from ii_core.picture.picture import IIPicture
from ii_core.picture.view import camera_of, five_viewpoints

from .plan import Options, frame_order, frames_per_second, make_plan
from .plates import plates

MAX_EMBEDDED = 256 << 20  # bytes; browsers read no more in reasonable time
WIDTH = {"dsis": 900, "pairs": 600}  # width in pixels of the screen to which small views are enlarged
CONE = 0.9  # share of the viewing zone that a path covers


@dataclass(frozen=True, kw_only=True)
class Stimulus:
    """A picture that observers judge.

    Parameters
    ----------
    scene, name : str
        Name of the scene, and name of the picture among the others of its scene.
    picture : IIPicture
        Regular, with the structure of its scene's reference.
    reference : bool
        Whether it is the picture before coding.
    scheme : str
        Scheme that coded the picture.
    bpp : float, optional
        Bits per pixel.
    measures : mapping of str to float
        Quality of the picture by each measure, for comparison with the opinions.
    """

    scene: str
    name: str
    picture: IIPicture
    reference: bool = False
    scheme: str = ""
    bpp: float | None = None
    measures: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        text, flag = checks.text, checks.flag
        picture, measures = checks.instance(IIPicture), checks.mapping
        checks.check_fields(
            self, scene=text, name=text, picture=picture, reference=flag, scheme=text, bpp=checks.number,
            measures=measures,
        )  # fmt: skip
        for name, value in self.measures.items():
            checks.text("measures", name)
            checks.number(f"measures: {name}", value)

    @property
    def entry(self) -> dict[str, Any]:
        """Entry of the plan; measures without a finite value are left out."""
        finite = {name: float(value) for name, value in self.measures.items() if np.isfinite(value)}
        plain = {"scene": self.scene, "name": self.name, "reference": self.reference, "scheme": self.scheme}
        return {**plain, "bpp": self.bpp, "measures": finite}


@checks.checked(
    path=checks.path, stimuli=checks.list_of(Stimulus), options=checks.instance(Options), title=checks.text,
    served=checks.flag, progress=checks.callable_,
)  # fmt: skip
def write_test(
    path: str | os.PathLike[str],
    stimuli: Sequence[Stimulus],
    options: Options | None = None,
    *,
    size: Pair | None = None,
    title: str = "Quality of pictures",
    served: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write a test with observers as one HTML file, which opens from disk or from `--serve`.

    Parameters
    ----------
    path : path
        The page; replaced whole.
    stimuli : list of Stimulus
        For each scene one reference and the coded pictures.
    options : Options, optional
    size : (width, height), optional
        Pixels of a view; one a lens if not given. Small views are shown enlarged by a whole factor.
    title : str
        Shown to the observers.
    served : bool
        Whether the page sends results to the server that it comes from, or has them downloaded.
    progress : callable, optional
        Called with the number of views done and of all views.

    Returns
    -------
    dict
        The plan, as results hold it.

    Raises
    ------
    ValueError
        If a scene lacks its reference or a coded picture, two stimuli have one name, structures differ, or the page
        would be larger than `MAX_EMBEDDED`.
    OSError
        If the file cannot be written.
    """
    if not title.isprintable():
        raise ValueError(f"title is {title!r}: one line without control characters is needed")
    asked = options or Options()
    _check(stimuli)
    width, height = view_size("size", stimuli[0].picture.lenses if size is None else size)
    count, sequence = frame_order(asked.show, asked.frames)
    made = plates(asked.seed)
    plan = make_plan(
        [one.entry for one in stimuli],
        _errors(stimuli),
        asked,
        title=title,
        show=asked.show,
        size=[width, height],
        zoom=max(1, WIDTH[asked.method] // width),
        sequence=sequence,
        fps=frames_per_second(asked.show, len(sequence), asked.seconds),
        plates=[plate.digit for plate in made],
    )
    nonce = nonce_of(json.dumps(plan))
    head, tail = _html(plan, served, nonce).split("\x00")
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(head)
        for number, plate in enumerate(made):
            file.write(_call(nonce, "plate", number, 0, plate.png))
        total, done = len(stimuli) * count, 0
        for number, one in enumerate(stimuli):
            for place, view in enumerate(_views(one.picture, asked.show, count, (width, height))):
                file.write(_call(nonce, "frame", number, place, _encoded(view)))
                if file.tell() > MAX_EMBEDDED:
                    raise ValueError(
                        f"{path} would be larger than {MAX_EMBEDDED >> 20} MB: fewer frames, fewer pictures or a "
                        "smaller size are needed"
                    )
                done += 1
                if progress:
                    progress(done, total)
        file.write(f'<script nonce="{nonce}">ii.done()</script>' + tail)
    return plan


def _check(stimuli: Sequence[Stimulus]) -> None:
    if not stimuli:
        raise ValueError("there are no stimuli: a reference and a coded picture are needed")
    names = [(one.scene, one.name) for one in stimuli]
    for one in stimuli:
        one.picture.check_regular()
        if names.count((one.scene, one.name)) > 1:
            raise ValueError(f"scene {one.scene!r} has two stimuli named {one.name!r}: each needs a name of its own")
        for other in stimuli:
            if other.reference and other.scene == one.scene:
                other.picture.check_same_structure(one.picture)


def _errors(stimuli: Sequence[Stimulus]) -> list[float]:
    """Mean squared error of each picture against its reference, for the training alone."""
    references = {one.scene: one.picture.pixels for one in stimuli if one.reference}
    return [
        float(np.mean(np.square(one.picture.pixels.astype(np.float32) - references[one.scene])))
        if one.scene in references
        else 0.0
        for one in stimuli
    ]


def _views(picture: IIPicture, show: str, count: int, size: Pair) -> Iterator[NDArray[np.uint8]]:
    shown = with_assumed_camera(picture)
    if show in ("front", "views"):
        places: Any = list(five_viewpoints(camera_of(shown)).values())[:count]
    else:
        places = (viewpoints_across if show == "across" else viewpoints_around)(shown, count, cone=CONE)
    for place in places:
        yield focused_view(shown, place, size=size)


def _html(plan: Mapping[str, Any], served: bool, nonce: str) -> str:
    """Return the page, with a NUL in the place of its data."""
    folder = files(__package__)
    page, style, script = (
        (folder / name).read_text(encoding="utf-8") for name in ("page.html", "style.css", "test.js")
    )
    text = json.dumps(json.dumps(plan, ensure_ascii=False), ensure_ascii=False).replace("<", "\\u003c")
    start = f"{script}\nii.start({text}, {json.dumps(served)});"
    texts = {"title": html.escape(plan["title"]), "style": style, "script": start, "data": "\x00"}
    return Template(page).substitute(texts, policy=policy(nonce, served=served), nonce=nonce)


def _call(nonce: str, kind: str, number: int, place: int, data: bytes) -> str:
    return f'<script nonce="{nonce}">ii.{kind}({number}, {place}, "{base64.b64encode(data).decode()}")</script>\n'


def _encoded(view: NDArray[np.uint8]) -> bytes:
    out = io.BytesIO()
    Image.fromarray(view).save(out, "WEBP", lossless=True, quality=20, method=2)
    return out.getvalue()
