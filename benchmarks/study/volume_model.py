"""Volume coded by the verification model of JPEG 2000 Part 10, if installed (Olsson 2008, §5.7.3.2).

It is part of OpenJPEG up to 2.4: ``cmake -DBUILD_JP3D=ON`` builds ``opj_jp3d_compress`` and ``opj_jp3d_decompress``,
which must be on the path. It codes grey volumes only, so each colour is a volume of its own with a third of the bits.
Our volume coder, given the same three volumes, shows the cost of this restriction.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec import decode, encode
from codec.order import selection_order
from ii_core import IIPicture
from ii_core.picture.component import component_images, picture_pixels
from metrics import q_global

from .coding import CODED, FLOOR, RATES, SCENES, shot
from .rates import VOLUME
from .runner import Step

ENCODER, DECODER = "opj_jp3d_compress", "opj_jp3d_decompress"
# Five levels of CDF 5/3 along each axis. With two-dimensional blocks, version 2.4 cannot decode its own streams.
SETTINGS = ("-n", "6,6,6", "-C", "3EB")
HEADER = "Bpp\t8\nColor Map\t2\nDimensions\t{}\t{}\t{}\nResolution(mm)\t1\t1\t1\n"
MODEL, APART = "verification model", f"{VOLUME}, colours apart"
SHARE = 1 / 3  # share of the bits of each colour
COARSEST = 8  # smaller sub-images have too few pixels for five levels


def steps(scale: int) -> list[Step]:
    """Return all steps; none without the programs."""
    if shutil.which(ENCODER) is None or shutil.which(DECODER) is None:
        return []
    return [
        Step(
            name=f"volume-{scene}",
            shows=f"SI-PVI of Figure 5.10 by the verification model, {scene}",
            run=volumes,
            parameters={"scene": scene, "scale": min(scale, COARSEST)},
            uses=CODED,
        )
        for scene in SCENES
    ]


def volumes(_folder: Path, *, scene: str, scale: int) -> dict[str, Any]:
    """Return curves of Q_global with each colour coded alone, by the verification model and by our coder."""
    picture = shot(scene, "setup1", scale).picture
    points = []
    for scheme, coder in ((MODEL, by_model), (APART, by_ours)):
        for rate in reversed(RATES):
            decoded, size, seconds = coder(picture, SHARE * rate)
            bpp = 8 * size / decoded[..., 0].size
            points.append(
                {
                    "scheme": scheme,
                    "target_bpp": rate,
                    "bpp": bpp,
                    "q_global": q_global(picture, IIPicture(decoded, picture.lenses, picture.ei_pixels)),
                    "encode_seconds": seconds,
                }
            )
            if bpp > FLOOR * rate:
                break
    return {"points": points}


def by_model(picture: IIPicture, bpp: float) -> tuple[NDArray[np.uint8], int, float]:
    """Return pixels, bytes and CPU seconds of encoding."""
    images = component_images(picture, "si")
    rows, cols, height, width = images.shape[:4]
    order = selection_order("parallel", rows, cols)
    slices = images.reshape(rows * cols, height, width, 3)
    decoded = np.empty_like(slices)
    total, seconds = 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        for colour in range(3):
            volume = np.ascontiguousarray(slices[order, ..., colour])
            decoded[order, ..., colour], size, spent = there_and_back(volume, bpp, Path(folder))
            total, seconds = total + size, seconds + spent
    return picture_pixels(decoded.reshape(images.shape), "si"), total, seconds


def there_and_back(volume: NDArray[np.uint8], bpp: float, folder: Path) -> tuple[NDArray[np.uint8], int, float]:
    """Return a coded and decoded grey volume, its bytes, and CPU seconds of encoding.

    Raises
    ------
    OSError
        If one of the programs fails.
    """
    slices, height, width = volume.shape
    (folder / "volume.img").write_text(HEADER.format(width, height, slices), encoding="ascii")
    volume.tofile(folder / "volume.bin")
    before = os.times()
    run(folder, ENCODER, "-i volume.bin -m volume.img -o volume.jp3d -r", f"{8 / bpp:.3f}", *SETTINGS)
    after = os.times()
    run(folder, DECODER, "-i volume.jp3d -o decoded.bin -m decoded.img")
    seconds = after.children_user + after.children_system - before.children_user - before.children_system
    decoded = np.fromfile(folder / "decoded.bin", np.uint8)
    if decoded.size != volume.size:
        raise OSError(f"{DECODER} left {decoded.size} voxels: {volume.size} are needed")
    size = (folder / "volume.jp3d").stat().st_size
    return decoded.reshape(volume.shape), size, max(0.0, seconds)  # rounding may make the difference negative


def run(folder: Path, program: str, arguments: str, *more: str) -> None:
    """Run a program in a folder."""
    done = subprocess.run(
        [program, *arguments.split(), *more], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise OSError(f"{program} ended with {done.returncode}: {(done.stdout + done.stderr).strip()[-300:]}")


def by_ours(picture: IIPicture, bpp: float) -> tuple[NDArray[np.uint8], int, float]:
    """Return the same results by our coder."""
    decoded = np.empty_like(picture.pixels)
    total, seconds = 0, 0.0
    for colour in range(3):
        grey = np.repeat(picture.pixels[..., colour : colour + 1], 3, axis=2)
        coded = encode(IIPicture(grey, picture.lenses, picture.ei_pixels), VOLUME, bpp=bpp)
        decoded[..., colour] = decode(coded).pixels[..., 0]
        total, seconds = total + len(coded.payload), seconds + (coded.codec_seconds or 0.0)
    return decoded, total, seconds
