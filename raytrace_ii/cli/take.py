"""Takes on the command line: render --frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .common import check_outputs, progress_bar
from .words import say


def render_frames(
    name: str, moving: dict[str, Any], frames: str, folder: Path, array: Any, support: dict[str, list[str]],
    force: bool, options: dict[str, Any],
) -> None:  # fmt: skip
    """Render frames of a take into a folder."""
    from ..files.take import load_take
    from ..rendering.render_take import MANIFEST, render_take

    check_outputs([folder / MANIFEST], True, make_folder=True)
    take = load_take(name, **moving)
    numbers = _frame_numbers(frames, take.frames)
    with progress_bar(f"render {take.name}") as report:

        def told(number: int, done: int, total: int) -> None:
            report(numbers.index(number) * total + done, len(numbers) * total, f"frame {number}")

        manifest = render_take(
            take, folder, array, frames=numbers, support=support, force=force, progress=told, **options
        )
    made = [manifest["frames"][str(number)] for number in numbers]
    seconds, rays = sum(m["seconds"] for m in made), sum(sum(m["rays"].values()) for m in made)
    say(f"{folder}: {len(made)} frames of {take.fps:g} a second, {rays / 1e6:.1f} M rays in {seconds:.1f} s in all")


def _frame_numbers(text: str, count: int) -> list[int]:
    first, dots, last = text.partition("..")
    try:
        numbers = range(count) if text == "all" else range(int(first), int(last if dots else first) + 1)
    except ValueError:
        raise ValueError(f"frames is {text!r}: one number, two like 0..47, or all is needed") from None
    if not numbers or numbers[0] < 0 or numbers[-1] >= count:
        raise ValueError(f"frames is {text!r}: the take has frames 0..{count - 1}")
    return list(numbers)


def support_files(kinds: list[str], together: Path | None, extra: dict[str, Path]) -> dict[str, list[str]]:
    """Support images by the name of their file; ``kinds`` share the file ``together``."""
    found: dict[str, list[str]] = {together.name: list(kinds)} if together is not None else {}
    for kind, path in extra.items():
        found.setdefault(path.name, []).append(kind)
    return found
