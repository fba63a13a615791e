"""Commands that show II-pictures: view."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Force, app, check_output, load_any, progress_bar


@app.command()
def view(
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar.")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The page, .html.")] = None,
    compare: Annotated[Path | None, typer.Option(help="A decoded II-picture, or a coded file, beside it.")] = None,
    depth: Annotated[Path | None, typer.Option(help="A map of z in mm, .exr, by which clicks focus.")] = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="Pixels as they are, in a larger page.")] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="Serve the page on this machine instead of writing it.")
    ] = False,
    port: Annotated[int, typer.Option(help="To serve on; 0 for any that is free.")] = 0,
    force: Force = False,
) -> None:
    """Look at an II-picture in a browser: parallax, focus, comparison, stereo."""
    from ii_core import IIPicture
    from ii_core.files import read_image
    from metrics.viewer import write_viewer, write_viewer_folder

    if (output is None) == (not serve):
        raise ValueError("one of --output and --serve is needed")
    if output is not None:
        if output.suffix not in (".html", ".htm"):
            raise ValueError(f"{output} is no page: .html is needed")
        check_output(output, force)
    options: dict[str, Any] = {"title": picture.stem, "lossless": lossless}
    original = IIPicture.load(picture)
    decoded = load_any(compare) if compare else None
    if depth is not None:
        options["depth"] = read_image(depth)[..., 0]
    with progress_bar(f"view {picture.name}") as report:
        options["progress"] = lambda done, total: report(done, total, "")
        if output is not None:
            size = write_viewer(output, original, decoded, **options)
            print(f"{output}: {size / 2**20:.1f} MB")
            return
        import tempfile

        folder = tempfile.TemporaryDirectory(prefix="raytrace-ii-")
        write_viewer_folder(folder.name, original, decoded, **options)
    with folder:
        _serve(folder.name, port)


def _serve(folder: str, port: int) -> None:
    """Serve a folder to this machine alone, until interrupted."""
    from functools import partial
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", port), partial(Quiet, directory=folder)) as server:
        print(f"http://127.0.0.1:{server.server_port}/ shows it, until Ctrl-C", flush=True)
        server.serve_forever()
