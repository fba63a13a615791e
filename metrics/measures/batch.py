"""Measures of many decoded pictures against one reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture
from ii_core.base import checks
from ii_core.depth.focus import FocusDepth, depth_from_focus

from .measure import measure_of
from .pair import PicturePair
from .quality import DepthQuality


@checks.checked(names=checks.sequence, layers_mm=checks.numbers, method=checks.text)
def measuring(
    reference: IIPicture,
    names: Sequence[str],
    *,
    depth: ArrayLike | FocusDepth | None = None,
    layers_mm: ArrayLike | None = None,
    method: str = "dissertation",
) -> Callable[[IIPicture], dict[str, Any]]:
    """Return a function that measures decoded pictures. Work that depends on the reference alone is done once.

    Parameters
    ----------
    reference : IIPicture
    names : sequence of str
        Registered measures, see `MEASURES`.
    depth, layers_mm, method
        As for `q_depth`, if a measure needs depth. Depth is estimated in this call if it is not given.

    Returns
    -------
    callable
        ``measure(decoded, codes=None)``, with ``codes`` of `PicturePair`, returns a dict of values by name. Measures
        over depth add ``q_depth``, the value of every layer, ``depth_mm``, the layers, and ``depth_outside``, the
        share of view pixels outside all layers.

    Raises
    ------
    TypeError
        If ``reference`` is not an `IIPicture`, or ``names`` is not a sequence of text.
    ValueError
        If a name is unknown, or the reference lacks a need of a measure: camera, regular structure, number of lenses.
    """
    if bad := [name for name in names if not isinstance(name, str)]:
        raise TypeError(f"names hold {bad[0]!r}: text is needed")
    measures = [measure_of(name) for name in names]
    pair = PicturePair(reference, reference, depth=depth, layers_mm=layers_mm, method=method)
    for measure in measures:
        if (reason := measure.needs.unmet(pair)) is not None:
            raise ValueError(f"{measure.name}: {reason}")
    if depth is None and any(measure.needs.depth for measure in measures):
        pair = replace(pair, depth=depth_from_focus(reference, layers_mm=layers_mm, method=method))

    return _Measuring(pair, tuple(names))


@dataclass(frozen=True)
class _Measuring:
    """Measures of decoded pictures against the reference of a pair; other processes can be sent it."""

    pair: PicturePair
    names: tuple[str, ...]

    def __call__(self, decoded: IIPicture, codes: NDArray[Any] | None = None) -> dict[str, Any]:
        compared = replace(self.pair, decoded=decoded, codes=codes)
        results: dict[Any, Any] = {}
        kept: dict[str, Any] = {}
        for measure in map(measure_of, self.names):
            if measure.compute not in results:
                results[measure.compute] = measure.result(compared)
            kept[measure.name] = measure.number(results[measure.compute])
        for result in results.values():
            if isinstance(result, DepthQuality):
                kept |= {"q_depth": result.values.tolist(), "depth_mm": result.depth_mm.tolist()}
                kept["depth_outside"] = result.outside_share
        return kept
