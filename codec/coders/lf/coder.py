"""Light-field coder ``si-lf``: sub-images on their grid, predicted by disparity from decoded neighbours."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ... import clock
from ...contract import Coder, Goal, Option, Options, Pixels
from ...search import Axis, CodingResult, Run, meet_size, nearest, trials
from . import (
    arithmetic,
    denoise,
    loop_filter_search,
    planes,
    ranges,
    rig,
    rig_search,
    search,
    stream,
    synthesis,
)
from .blocks import code_blend, code_view
from .contexts import Contexts
from .field import NO_GUESS, Field
from .pyramid import Node, Place, pyramid
from .search import Search
from .state import MOST_REFERENCES, Job, Work, new_work, zeros
from .stream import Header

FINEST, COARSEST = 0, 63
FRACTIONS = 16  # of a quantiser, between which a rate is searched
OCTAVE = -6.0 * FRACTIONS  # quantisers that double a size, about
START = 34 * FRACTIONS
COARSEST_DB, FINEST_DB = 10.0, 60.0
QUALITY_RUNS, NEAR_DB, DB_A_STEP = 10, 0.05, 0.8  # PSNR falls so much from one quantiser to the next, about
# Of the blocks that predict a view which is coded lossless; the better one is kept.
EXACT_SETTINGS = 26 * FRACTIONS, 44 * FRACTIONS
GOOD = 0.3, 0.22, 0.1  # cost of a block by effort, in bits a sample, below which nothing else is tried
# Views of more samples than so many are smoother, and their blocks cheaper: there GOOD is less by their share.
GOOD_SAMPLES = 128 * 64
SURELY = 5.0, 5.0, 2.0  # times GOOD: intra modes are not tried below it
# intra modes of the first view that are compared by coefficients and coded on trial, by effort
FIRST_ESTIMATES, FIRST_TRIES = (0, 12, 20), (1, 4, 8)
HALVINGS = 0, 1, 2  # of squares of blocks; one more of the first view by `best`
BLEND_ROWS = 4, 4, 1  # the kind of blending is chosen by every so many-th row
WEIGHT = 0.12  # squared error a bit is worth, in squared steps
# Quantisers by which each level is finer than the next, for more is predicted from it. The first view is finer than
# the last ones by so many, and so many more for each doubling of the views that it predicts.
FINER_A_LEVEL, FINER_FIRST, FINER_A_DOUBLING = 1.5, 5.0, 1.1
DENOISED_LEVELS = 2  # of views, by neighbours, from `balanced` on
TRIAL_LEVELS = 2  # of views that show how errors share among planes
CROSS = stream.QUARTERS, stream.EIGHTHS  # unit of factors between planes: of principal axes, and of BT.709
MOST_VIEWS = 1 << 14
MOST_AT_ONCE = 1 << 20  # samples of views whose blocks are found before they are coded, unless there are more threads
VIEW_BYTES, EXACT_BYTES = 24, 96  # a sample's most
# Settings that meet a size.
SIZES = Axis(low=FINEST * FRACTIONS, high=COARSEST * FRACTIONS, start=START, octave=OCTAVE, step=1)


class LightField(Coder):
    """Sub-images as views of a light field; docs/lf.md explains the stream."""

    kind = "si"
    components_alone: ClassVar[bool] = True
    name = "si-lf"
    about = "Sub-images as a light field, tuned for PSNR-YUV (6:1:1) or RGB: disparity, synthesis at the decoder"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    qp_range: ClassVar[tuple[int, int] | None] = (FINEST, COARSEST)
    quality_range: ClassVar[tuple[float, float] | None] = (COARSEST_DB, FINEST_DB)
    scale_about = (
        "of qp the step doubles every 6, and is one 8-bit code at 8; quality is PSNR in dB by the measure of tune"
    )
    options: ClassVar[Mapping[str, Option]] = {
        "stride": Option(about="binary logarithm of the first views' distance on the grid", default=3, low=0, high=6),
        "sources": Option(about="views that a synthesis is made of, 0 for none", default=4, low=0, high=8),
        "cross": Option(about="1 to predict colours from the first plane", default=1, low=0, high=1),
        "skip": Option(
            about="1 to code residuals of small blocks without a transform where it pays", default=1, low=0, high=1
        ),
        "tune": Option(
            about="measure: PSNR-YUV of JPEG Pleno's test conditions (6:1:1, BT.709), or PSNR of RGB and of grey",
            default="ctc",
            choices=("ctc", "rgb"),
        ),
        "lossless": Option(about="1 to code to the bit", default=0, low=0, high=1),
        "threads": Option(
            about="threads that share the views; the bytes do not depend on it", default=1, low=1, high=16
        ),
        "effort": Option(about="of the search: 0, 1 or 2", default=1, low=0, high=2),
    }
    presets: ClassVar[Mapping[str, Options]] = {
        "fast": {"effort": 0, "skip": 0},
        "balanced": {"effort": 1},
        "best": {"effort": 2},
    }

    @property
    def versions(self) -> dict[str, str]:
        """The kernels are our own."""
        return {"numba": numba.__version__}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Any size will do that has no more views than there is patience for."""
        check_views(picture)

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a rate or a quality by a search of the quantiser."""
        source = Source(picture, options)
        if self.lossless(options):
            runs = [source.run(setting) for setting in EXACT_SETTINGS]
            return CodingResult(run=min(runs, key=lambda run: len(run.payload)), runs=len(runs))
        if goal.qp is not None:
            return CodingResult(run=source.run(goal.qp * FRACTIONS))
        if goal.quality is not None:
            return _meet_quality(source, goal.quality)
        assert goal.bpp is not None
        start = START + OCTAVE * math.log2(min(max(goal.bpp, 1e-3), 100) * 10)
        return meet_size(source.run, goal.bpp * source.count / 8, replace(SIZES, start=start))

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Level by level; a level that ends early is damage."""
        started = clock.cpu_seconds()
        field, levels = _opened(payload, blank)
        pixels = np.empty(blank.pixels.shape, blank.pixels.dtype)
        for _, nodes, _ in decoded_batches(field, levels, threads_of(options)):
            field.show(pixels, nodes)
            field.forget(nodes)
        return pixels, clock.cpu_seconds() - started

    def decode_component(self, payload: bytes, blank: IIPicture, options: Options, index: int) -> Pixels:
        """One sub-image, counted row by row; see `decode_view`."""
        return self.decode_view(payload, blank, options, divmod(index, blank.ei_pixels[0]))[0]

    def decode_view(
        self, payload: bytes, blank: IIPicture, options: Options, place: Place
    ) -> tuple[Pixels, int, int]:
        """A view by row and column, bytes read, and views decoded: those of the levels above and some of its own.

        Raises
        ------
        ValueError
            If the payload is damaged so far as it is read.
        """
        field, levels = _opened(payload, blank)
        views = 0
        for _, nodes, read in decoded_batches(field, levels, threads_of(options)):
            views += len(nodes)
            if any((node.row, node.col) == place for node in nodes):
                return field.view_pixels(field.number(place)).copy(), read, views
        raise ValueError(f"there is no view in row {place[0]}, column {place[1]}")

    def decode_levels(self, payload: bytes, blank: IIPicture, options: Options) -> Iterator[tuple[int, Field, int]]:
        """Decode level by level; yield the level, all views decoded so far, and the bytes read."""
        field, levels = _opened(payload, blank)
        views = 0
        for level, nodes, read in decoded_batches(field, levels, threads_of(options)):
            views += len(nodes)
            if views == len(field.levels[level]):
                views = 0
                yield level, field, read


def _opened(payload: bytes, blank: IIPicture) -> tuple[Field, list[bytes]]:
    check_views(blank)
    header, levels = stream.unpack(payload, blank.pixels.size // 3)
    height, width, grid = shape(blank)
    return Field(header, grid, height, width, blank.pixels.dtype), levels


def threads_of(options: Options) -> int:
    """Return the number of threads."""
    return int(options.get("threads", 1))


def decoded_batches(
    field: Field, levels: list[bytes], threads: int = 1, contexts: Contexts | None = None
) -> Iterator[tuple[int, list[Node], int]]:
    """Decode one batch of views after another; yield the level, the views, and the bytes read so far."""
    contexts, work = contexts or Contexts(field.header.refined), new_work()
    before = stream.head_bytes(field.header, levels)
    with clock.Workers(threads) as workers:
        for level, data in enumerate(levels):
            coder = arithmetic.reader(contexts.of(level), data, refined=field.header.refined)
            for nodes in field.batches(level):
                jobs, made = zip(*workers.map(field.job, nodes), strict=True)
                blends = [code_blend(coder, 0) if job.synthesised else 0 for job in jobs]
                workers.map(_blended, jobs, made, blends)
                for job in jobs:
                    field.code(coder, job, work)
                    if arithmetic.overrun(coder):
                        raise ValueError(f"level {level} of its light field ends early")
                workers.map(field.refine, nodes, jobs, made)
                field.finish(nodes)
                del job, jobs, made  # before the next batch takes as much
                yield level, nodes, before + min(int(coder.state[arithmetic.AT]), len(data))
            contexts.after(level)
            before += len(data)


def _blended(job: Job, made: synthesis.Synthesis, nearest: int) -> None:
    if job.synthesised:
        synthesis.blend(made, nearest, 1)


def check_views(picture: IIPicture) -> None:
    """Each view takes a millisecond, however small it is."""
    u, v = picture.ei_pixels
    if u * v > MOST_VIEWS:
        raise ValueError(f"the picture has {u}×{v} views: at most {MOST_VIEWS} are coded as a light field")


def shape(picture: IIPicture) -> tuple[int, int, tuple[int, int]]:
    """Height and width of a view, rows and columns of views."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    return l, k, (v, u)


def _meet_quality(source: Source, quality: float) -> CodingResult:
    """Meet a PSNR in dB; the first quantiser is that of which half the uniform error is the one allowed."""

    def try_at(setting: float) -> tuple[Run, float]:
        started = clock.cpu_seconds()
        payload, field = source.coded(setting)
        return Run(payload, clock.cpu_seconds() - started), quality - source.psnr(field)

    allowed = 255**2 / 10 ** (quality / 10)
    axis = Axis(
        low=FINEST * FRACTIONS,
        high=COARSEST * FRACTIONS,
        start=FRACTIONS * (8 + 3 * math.log2(24 * allowed)),
        octave=FRACTIONS,
        step=1,
        overshoot=0.0,
        runs=QUALITY_RUNS,
    )
    tried = list(
        trials(try_at, lambda run: run[1] / DB_A_STEP, axis, enough=lambda miss: abs(miss) <= NEAR_DB / DB_A_STEP)
    )
    return CodingResult(run=nearest(tried).result[0], runs=len(tried))


class Source:
    """A picture to be coded at one quantiser after another."""

    def __init__(self, picture: IIPicture, options: Options) -> None:
        self.pixels = np.ascontiguousarray(picture.pixels)
        self.count = self.pixels.size // 3
        self.height, self.width, self.grid = shape(picture)
        self.effort, self.threads = int(options["effort"]), int(options["threads"])
        exact = bool(options["lossless"])
        scales = None if exact or options["tune"] == "rgb" or _grey(self.pixels) else planes.FIRST_SCALES
        if scales:
            self.axes, colours = planes.bt709_axes(scales), planes.bt709_colours(scales)
        else:
            self.axes = colours = planes.detail_axes(self.pixels, self.grid)
        low, high, lattice = ranges.estimated(self.view, self.grid, skewed=not exact)
        self.rig, entries = None, None
        if not exact:
            entries = rig_search.departures(self.view, self.grid, lattice, (low, high))
        if entries is not None:
            self.rig = rig.rig(entries, *self.view(0, 0).shape[1:])
            low, high = ranges.moved_range(self.view, self.grid, lattice, self.rig)
        self._target_of: Any = None
        self._latest_target = np.zeros((3, 0, 0), np.int16)
        self.header = Header(
            log_stride=int(options["stride"]),
            sources=int(options["sources"]),
            exact=exact,
            lattice=lattice,
            low=low,
            high=high,
            colours=colours,
            scales=scales,
            crossed=CROSS[bool(scales)] if options["cross"] else 0,
            skipping=bool(options["skip"]) and not exact,
            tuned=not exact,
            filtered=not exact,
            dependent=not exact,
            directed=not exact,
            parted=not exact,
            refined=not exact,
            limited=not exact,
            guided=not exact,
            learnt=not exact,
            rig=b"" if entries is None else rig.pack(entries, self.grid[0] // 2 * self.grid[1] + self.grid[1] // 2),
            steps=(),
        )

    def view(self, row: int, col: int) -> NDArray[np.int16]:
        """Planes of a view, with sides that are multiples of 4."""
        out = np.empty((3, -(-self.height // 4) * 4, -(-self.width // 4) * 4), np.int16)
        sixteen = self.pixels.itemsize == 2
        planes.gather(self.pixels, self.grid, row, col, self.axes, sixteen, out)
        return out

    def psnr(self, field: Field) -> float:
        """PSNR in dB of what the decoder shows, by the measure that is tuned for."""
        rows, cols = self.grid
        error, views = 0.0, []
        for number in range(len(field.views)):
            row, col = divmod(number, cols)
            original, decoded = self.pixels[row::rows, col::cols], field.view_pixels(number)
            if self.header.scales:
                views.append(planes.psnr_yuv(original, decoded))
            else:
                error += float(np.square(decoded.astype(np.float32) - original).sum(dtype=np.float64))
        if views:
            return float(np.mean(views))
        top = np.iinfo(self.pixels.dtype).max
        return 10 * math.log10(top**2 * self.pixels.size / max(error, 1e-9))

    def run(self, setting: float) -> Run:
        """The payload at a quantiser."""
        started = clock.cpu_seconds()
        payload, _ = self.coded(setting, forgetful=True)
        return Run(payload, clock.cpu_seconds() - started)

    def coded(self, setting: float, *, forgetful: bool = False) -> tuple[bytes, Field]:
        """The payload at a quantiser, and what the decoder will make of it: all, or views that predict others."""
        field = self.field(self.header_at(setting))
        levels = self.levels(field, Contexts(field.header.refined), forgetful=forgetful)
        return stream.pack(field.header, levels, self.count), field

    def header_at(self, setting: float) -> Header:
        """Return the header at a quantiser, with the scales of Cb and Cr that a trial of the first views gives."""
        header = replace(self.header, steps=self.steps(setting))
        if header.scales is None:
            return header
        scales = planes.FIRST_SCALES
        header = self._scaled(header, scales)
        trial = self.field(header)
        # All with the step of most views, by which errors are those of most views.
        step = header.steps[max(i for i, level in enumerate(trial.levels) if level)]
        trial.header = replace(header, steps=(step,) * len(header.steps))
        trial.levels = trial.levels[:TRIAL_LEVELS]
        effort, self.effort = self.effort, 0
        self.levels(trial, Contexts(trial.header.refined))
        self.effort = effort
        errors = np.zeros(3)
        for place in np.argwhere(trial.decoded).tolist():
            decoded = trial.views[trial.number((place[0], place[1]))]
            errors += np.square(decoded.astype(np.float32) - self.view(*place)).sum(axis=(1, 2), dtype=np.float64)
        return self._scaled(header, planes.better_scales(scales, errors, len(trial.views)))

    def _scaled(self, header: Header, scales: tuple[int, int]) -> Header:
        """Return the header with other scales of planes; the source's planes get them, too."""
        self.axes = planes.bt709_axes(scales)
        return replace(header, scales=scales, colours=planes.bt709_colours(scales))

    def steps(self, setting: float) -> tuple[int, ...]:
        """Return the quantiser's step of each level."""
        levels = pyramid(*self.grid, self.header.log_stride, MOST_REFERENCES, self.header.sources)
        if self.header.exact:
            offsets = [0.0] * len(levels)
        else:
            later = [len(level) > 0 for level in levels[1:]]  # levels without views make no difference
            finer = (FINER_A_LEVEL * sum(later[i + 1 :]) for i in range(len(later)))
            offsets = [self.finer_first(), *finer]
        return tuple(max(1, round(128 * 2 ** ((setting / FRACTIONS - 8 - less) / 6))) for less in offsets)

    def finer_first(self) -> float:
        """Return the quantisers by which the first view is finer than the last ones; 0 of a view alone."""
        views = self.grid[0] * self.grid[1]
        return FINER_FIRST + FINER_A_DOUBLING * math.log2(views) if views > 1 else 0.0

    def field(self, header: Header, past: Sequence[Field] = ()) -> Field:
        """Return the views to be coded: nothing yet, but the pixels if coding is lossless."""
        field = Field(header, self.grid, self.height, self.width, self.pixels.dtype, past)
        if header.exact:
            rows, cols = self.grid
            by_view = self.pixels.reshape(self.height, rows, self.width, cols, 3).transpose(1, 3, 0, 2, 4)
            field.pixels[:] = by_view.reshape(field.pixels.shape)
        return field

    def levels(self, field: Field, contexts: Contexts, *, forgetful: bool = False) -> list[bytes]:
        """Return the bytes of each level; the field then holds what the decoder will make of them."""
        work, levels = new_work(), []
        with clock.Workers(self.threads) as workers:
            for number in range(len(field.levels)):
                room = (EXACT_BYTES if field.header.exact else VIEW_BYTES) * field.shape[0] * field.shape[1] + 1024
                coder = arithmetic.writer(contexts.of(number), room, refined=field.header.refined)
                for nodes in field.batches(number):
                    costs = arithmetic.bit_costs(coder.contexts)
                    if number == 0 and self.effort and not field.header.exact and not field.past:
                        costs = self._learned_costs(field, nodes[0], costs, contexts, work)
                    some = max(self.threads, MOST_AT_ONCE // (field.shape[0] * field.shape[1]))
                    begun = partial(self._begun, field, forgetful=len(nodes) > some)
                    jobs, made, blends = zip(*workers.map(begun, nodes), strict=True)
                    for job, nearest in zip(jobs, blends, strict=True):
                        if job.synthesised:
                            code_blend(coder, nearest)
                    batch = list(zip(nodes, jobs, made, blends, strict=True))
                    del job, jobs, made
                    for first in range(0, len(nodes), some):
                        part = batch[first : first + some]
                        found = workers.map(partial(self._found, field, costs), part)
                        jobs, made, filters, guesses = zip(*found, strict=True)
                        for job, filtering in zip(jobs, filters, strict=True):
                            coder = arithmetic.enlarged(coder, room)
                            same = 0
                            if filtering:
                                same = loop_filter_search.choose_filters(
                                    coder, field.filters, job.at, filtering, worth(job.step)
                                )
                            field.code(coder, job, work, same)
                        workers.map(field.refine, nodes[first : first + some], jobs, made, guesses)
                        if forgetful:
                            field.forget(nodes[first : first + some])
                        del part, found, job, jobs, made, guesses  # before the next takes as much
                    del batch
                    field.finish(nodes)
                levels.append(arithmetic.finish(coder))
                contexts.after(number)
        return levels

    def _learned_costs(
        self, field: Field, node: Node, costs: NDArray[np.float32], contexts: Contexts, work: Work
    ) -> NDArray[np.float32]:
        """Return costs of bits after a first run of the first view, whose initial contexts are of other pictures."""
        job, _ = field.job(node)
        quick = self._search(job, self._target(field, node))._replace(intra_tries=1, halvings=1)
        search.find_blocks(costs, job, quick)
        room = VIEW_BYTES * job.levels[0].size + 1024
        coder = arithmetic.writer(contexts.of(node.level).copy(), room, refined=field.header.refined)
        code_view(coder, job, work)
        return arithmetic.bit_costs(coder.contexts)

    def _begun(self, field: Field, node: Node, *, forgetful: bool) -> tuple[Job, synthesis.Synthesis, int]:
        """A view's synthesis, and in which way that is blended; without the samples that `_found` blends again."""
        job, made = field.job(node)
        nearest = 0
        if job.synthesised:
            nearest = _nearer_blend(made, self._target(field, node), BLEND_ROWS[self.effort])
        if forgetful:
            nothing = made.made[:, :0].copy()
            job, made = job._replace(made=nothing, levels=nothing), made._replace(made=nothing)
        return job, made, nearest

    def _found(
        self, field: Field, costs: NDArray[np.float32], begun: tuple[Node, Job, synthesis.Synthesis, int]
    ) -> tuple[Job, synthesis.Synthesis, loop_filter_search.Found | None, NDArray[np.int32]]:
        """A view's blocks, found and decoded; its synthesis, its best filters, and the guess that these weigh."""
        node, job, made, nearest = begun
        if not made.made.size:
            samples, levels = (zeros((3, *field.shape))[0] for _ in range(2))
            job, made = job._replace(made=samples, levels=levels), made._replace(made=samples)
            if job.synthesised:
                synthesis.blend(made, nearest, 1)
        original = self._target(field, node)
        search.find_blocks(costs, job, self._search(job, original))
        filters, guess = None, NO_GUESS
        if field.header.filtered:
            limit, guess = field.limit(job.step), field.guess(node, job)
            filters = loop_filter_search.search_filters(field.views, job.at, original, limit, guess, worth(job.step))
        return job, made, filters, guess

    def _target(self, field: Field, node: Node) -> NDArray[np.int16]:
        """Return the planes to be coded: those of the view, with less noise where it predicts many others."""
        place, header = (node.row, node.col), field.header
        if node.level >= DENOISED_LEVELS or not self.effort or header.exact or field.past:
            return self.view(*place)
        key, limits = (place, header.steps, header.scales), (header.low, header.high)
        if self._target_of != key:  # the first view is coded twice
            found = denoise.denoised(self.view, self.grid, place, header.lattice, limits, header.steps[-1], self.rig)
            self._target_of, self._latest_target = key, found
        return self._latest_target

    def _search(self, job: Any, original: NDArray[np.int16]) -> Search:
        share = min(1.0, GOOD_SAMPLES / (self.height * self.width))
        # The first view is one of many, and of photographs half of all bytes and more: it is always searched well.
        first = self.effort > 0 and not len(job.references)
        effort = 2 if first else self.effort
        return Search(
            original=original,
            weight=np.float32(worth(job.step)),
            least=3 if effort == 0 else 2,
            intra_tries=FIRST_TRIES[self.effort] if first else (1, 1, 3)[effort],
            intra_estimates=FIRST_ESTIMATES[self.effort] if first else 0,
            halvings=HALVINGS[effort] + (first and self.effort == 2),
            good=np.float32(GOOD[effort] * share),
            surely=np.float32(SURELY[effort]),
            planes=1 if effort == 0 else 3,
            promising=int(self.effort < 2),
            hurried=int(effort < 2),
        )


def worth(step: int) -> float:
    """Return the squared error that a bit is worth at a quantiser."""
    return float(WEIGHT * (step / 16) ** 2)


def _grey(pixels: NDArray[Any]) -> bool:
    """Return whether red, green and blue are the same everywhere."""
    return bool((pixels[..., :2] == pixels[..., 1:]).all())


def _nearer_blend(made: synthesis.Synthesis, original: NDArray[np.int16], every: int) -> int:
    """Synthesise in the way that comes nearer to the original in every so many-th row, and return which it is."""
    errors = []
    for way in (0, 1):
        synthesis.blend(made, way, every)
        errors.append(_error(made.made[:, ::every], original[:, ::every]))
    best = int(errors[1] < errors[0])
    if every > 1 or not best:
        synthesis.blend(made, best, 1)
    return best


def _error(a: NDArray[np.int16], b: NDArray[np.int16]) -> float:
    return float(np.square(a.astype(np.float32) - b).sum())
