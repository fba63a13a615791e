"""Commands that code: schemes, encode, decode."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import Force, app, check_output, check_picture, columns, spinner


@app.command()
def schemes() -> None:
    """List the coding schemes."""
    from codec import schemes

    columns(schemes())


@app.command()
def encode(
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The coded file.")],
    scheme: Annotated[str, typer.Option(help="As in `raytrace-ii schemes`, options after a colon.")] = "si-h264",
    bpp: Annotated[float | None, typer.Option(help="Bits per pixel to aim at.")] = None,
    qp: Annotated[int | None, typer.Option(help="Quantiser to keep.")] = None,
    force: Force = False,
) -> None:
    """Code an II-picture."""
    from codec import encode
    from ii_core import IIPicture

    check_output(output, force)
    original = IIPicture.load(picture)
    with spinner(f"{scheme} codes {picture.name}"):
        coded = encode(original, scheme, bpp=bpp, qp=qp)
    coded.save(output)
    print(f"{output}: {coded.nbytes} bytes, {coded.bpp:.4g} bpp in {coded.encode_seconds:.1f} s")
    if not coded.reached:
        print(f"{scheme} cannot reach {bpp:g} bpp with this picture: {coded.bpp:.4g} is as near as it comes")


@app.command()
def decode(
    coded: Annotated[Path, typer.Argument(help="A file that `encode` wrote.")],
    output: Annotated[Path, typer.Option("-o", "--output", help=".png or .tif.")],
    force: Force = False,
) -> None:
    """Decode an II-picture."""
    from codec import decode

    check_picture(output, "uint8", force)
    with spinner(f"decode {coded.name}"):
        picture = decode(coded)
    picture.save(output)
