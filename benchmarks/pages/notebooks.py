"""Outputs of the notebooks: ``python -m benchmarks run notebooks``.

Runs each notebook of ``examples/`` in its own process and stores what its cells show: text, and pictures as JPEG.
Pages of HTML, the viewer among them, and lines of progress stay out: a notebook remains small.
"""

from __future__ import annotations

import base64
import io
import tempfile
from typing import Any

from PIL import Image

from benchmarks.records import ROOT

EXAMPLES = ROOT / "examples"
QUALITY = 85  # of JPEG


def main() -> None:
    """Run all notebooks."""
    import nbformat  # of the extra for notebooks
    from nbclient import NotebookClient

    for path in sorted(EXAMPLES.glob("*.ipynb")):
        book = nbformat.read(path, as_version=4)
        with tempfile.TemporaryDirectory() as folder:  # files of cells go there
            NotebookClient(book, timeout=600, resources={"metadata": {"path": folder}}).execute()
        for cell in book.cells:
            cell.metadata.pop("execution", None)  # times
            if cell.cell_type == "code":
                cell.outputs = [small(output) for output in cell.outputs if output.get("name") != "stderr"]
        book.metadata.language_info = {"name": "python"}
        nbformat.write(book, path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


def small(output: Any) -> Any:
    """Return an output with a JPEG in place of a PNG, and without HTML."""
    data = output.get("data", {})
    data.pop("text/html", None)
    if "image/png" in data:
        made = io.BytesIO()
        with Image.open(io.BytesIO(base64.b64decode(data.pop("image/png")))) as image:
            image.convert("RGB").save(made, "JPEG", quality=QUALITY)
        data["image/jpeg"] = base64.b64encode(made.getvalue()).decode()
    return output


if __name__ == "__main__":
    main()
