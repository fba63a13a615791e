"""Commands that turn II-pictures into other pictures: regular."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import Force, app, check_output, check_picture, spinner


@app.command()
def regular(
    picture: Annotated[Path, typer.Argument(help="An II-picture of a hexagonal, non-integer or shifted structure.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The same as a regular one.")],
    method: Annotated[
        str, typer.Option(help="rectangle (no pixel changes) or resample (centred on lenses).")
    ] = "resample",
    mask: Annotated[Path | None, typer.Option(help="Write which pixels a lens owns, white, to this .png.")] = None,
    force: Force = False,
) -> None:
    """Bring an II-picture to a regular structure, which coding and views need."""
    import numpy as np

    from ii_core import IIPicture, resampled, smallest_rectangle
    from ii_core.files import image_types, write_image

    methods = {"rectangle": smallest_rectangle, "resample": resampled}
    if method not in methods:
        raise ValueError(f"unknown method {method!r}: known are {', '.join(methods)}")
    image_types(output)
    check_output(output, force)
    if mask:
        check_picture(mask, "uint8", force)
    with spinner(f"{method} {picture.name}"):
        made, owned = methods[method](IIPicture.load(picture))
        made.save(output)
        if mask:
            write_image(mask, owned.astype(np.uint8) * 255)
    (k, l), (u, v) = made.lenses, made.ei_pixels
    print(f"{output}: {k}×{l} lenses of {u}×{v} px, {owned.mean():.1%} of the pixels owned by their lens")
