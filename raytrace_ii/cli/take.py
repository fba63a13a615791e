"""Takes on the command line: render --frames, and coding of folders of frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from .common import check_folder, check_outputs, columns, image_file, picture_files
from .progress import progress_bar, say_done, spinner
from .words import say

if TYPE_CHECKING:
    from ii_core import IIVideo


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
    about = f"{rays / 1e6:.1f} M rays, all rendered in {seconds:.1f} s"
    say_done(f"{folder}: {len(made)} frames of {take.fps:g} per second, {about}")


def _frame_numbers(text: str, count: int) -> list[int]:
    first, dots, last = text.partition("..")
    try:
        numbers = range(count) if text == "all" else range(int(first), int(last if dots else first) + 1)
    except ValueError:
        raise ValueError(f"frames is {text!r}: one number, two like 0..47, or all is needed") from None
    if not numbers or numbers[0] < 0 or numbers[-1] >= count:
        raise ValueError(
            f"frames is {text!r}: FIRST..LAST with 0 <= FIRST <= LAST <= {count - 1}, the last frame, is needed"
        )
    return list(numbers)


def support_files(kinds: list[str], together: Path | None, extra: dict[str, Path]) -> dict[str, list[str]]:
    """Return support images by the name of their file; ``kinds`` share the file ``together``."""
    found: dict[str, list[str]] = {together.name: list(kinds)} if together is not None else {}
    for kind, path in extra.items():
        found.setdefault(path.name, []).append(kind)
    return found


def encode_frames(folder: Path, output: Path, scheme: str, plan: Any, **goal: Any) -> None:
    """Code a folder of frames."""
    from codec import encode_take
    from ii_core import open_video

    video = open_video(folder)
    with progress_bar(f"{scheme} codes {folder.name}") as report:
        coded = encode_take(
            video, scheme, plan=plan, path=output, progress=lambda done, total: report(done, total, ""), **goal
        )
    say_done(
        f"{output}: {coded.frames} frames in {coded.nbytes} bytes, {coded.bpp:.4g} bpp, "
        f"{coded.mbit_per_second:.4g} Mbit/s"
    )
    if not coded.reached:
        say(f"{scheme} cannot reach {goal['bpp']:g} bpp with this take: the nearest rate is {coded.bpp:.4g} bpp")


def decode_frames(
    coded: Path, output: Path, frame: int | None, place: tuple[int, int] | None, force: bool, options: dict[str, Any]
) -> None:
    """Decode a take into a folder, or one frame or component image of it into a file."""
    from codec import EncodedTake, open_take
    from ii_core.base.atomic import atomic_folder
    from ii_core.base.files import write_image

    stream = EncodedTake.load(coded, partial=options.pop("partial"))
    video = open_take(stream, **options)
    if frame is None:
        if place is not None:
            raise ValueError("a component image of a take needs its --frame")
        check_folder(output, force)
        with progress_bar(f"decode {coded.name}") as report, atomic_folder(output) as folder:
            video.save(folder, lambda done, total: report(done, total, ""))
        say_done(f"{output}: {video.frames} frames")
        return
    if not 0 <= frame < video.frames:
        raise ValueError(f"frame is {frame}: {coded} has frames 0..{video.frames - 1}")
    files = picture_files if place is None else image_file
    check_outputs(files(output, stream.dtype), force)
    with spinner(f"decode {coded.name}"):
        if place is None:
            video[frame].save(output)
        else:
            write_image(output, video.component(frame, stream.scheme.partition("-")[0], place))


def measure_frames(reference: Path, decoded: Path, json: Path | None, plots: Path | None, force: bool) -> None:
    """Compare two takes over time."""
    from ii_core.base.files import write_json
    from ii_core.display.look import viewpoints_around
    from metrics import measure_take, time_chart

    from .video import opened

    chart = plots / "time.png" if plots else None
    check_outputs([*([json] if json else []), *([chart] if chart else [])], force, make_folder=True)
    a, b = opened(reference), opened(decoded)
    missing = _no_viewer(a)
    path = None if missing else viewpoints_around(a.structure, b.frames)
    with progress_bar(f"measure {decoded.name}") as report:
        quality = measure_take(a, b, viewpoints_mm=path, progress=lambda done, total: report(done, total, ""))
    if chart:
        time_chart({decoded.stem: quality}, chart)
    numbers = quality.to_json()
    if json:
        without = {"missing": {"view_ssim": missing, "view_psnr": missing}} if missing else {}
        write_json(json, {"reference": str(reference), "decoded": str(decoded), **numbers, **without})
    rows = {
        "frames": f"{numbers['frames']}, {quality.fps:g} per second",
        "Q_global": f"{quality.pooled_psnr:.2f} dB of the pooled error, {quality.mean_psnr:.2f} dB mean of frames, "
        f"{quality.worst_psnr:.2f} dB worst frame",
        "flicker": f"{quality.mean_flicker:.3f} 8-bit steps, mean of frames, where the original is still",
    }
    if missing:
        rows["moving viewer"] = f"not measured: {missing}"
    if quality.view_ssim is not None and quality.view_psnr is not None:
        rows["moving viewer"] = (
            f"MSSIM {quality.view_ssim.mean():.4f}, {quality.view_psnr.mean():.2f} dB, means of frames"
        )
    columns(rows)


def _no_viewer(video: IIVideo) -> str:
    """Return why a moving viewer is not measured; empty if it is."""
    if video.camera is None:
        return "the take has no camera"
    across, down = video.structure.lenses
    return f"view images have {across}×{down} pixels, SSIM needs 11×11" if min(across, down) < 11 else ""
