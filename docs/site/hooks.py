"""What the site does to the pages of docs/, so that the same pages read well in the repository.

A link out of docs/, to a script or to measured numbers, leads to that file: the site carries it along. A still of the
gallery leads to its page, which `make docs` makes. A public name that the reference lacks is a warning.
"""

from __future__ import annotations

import ast
import logging
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OUTWARD = re.compile(r"\]\((?P<path>(?:\.\./)+[^)#\s]+)")
STILL = re.compile(r"!\[\w+\]\((?P<name>\w+)\.webp\)")
log = logging.getLogger("mkdocs.hooks.docs")


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links to files outside docs/ into links to copies in the site."""

    def inside(match: re.Match[str]) -> str:
        path = (DOCS / page.file.src_uri).parent.joinpath(match["path"]).resolve()
        if not path.is_file() or path.is_relative_to(DOCS) or not path.is_relative_to(ROOT):
            return match[0]  # the build finds out whether that is a dead link
        uri = f"source/{path.relative_to(ROOT).as_posix()}"
        if files.get_file_from_path(uri) is None:
            files.append(File.generated(config, uri, abs_src_path=str(path)))
        return f"]({'../' * page.file.src_uri.count('/')}{uri}"

    if page.file.src_uri == "gallery/README.md":
        markdown = STILL.sub(r"[\g<0>](\g<name>.html)", markdown)
    return OUTWARD.sub(inside, markdown)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> None:
    """See that a page of the reference has all that its package's ``__all__`` names."""
    folder, _, package = page.file.src_uri.removesuffix(".md").rpartition("/")
    source = ROOT / package / "__init__.py"
    if folder != "api" or not source.is_file():  # a page of one module lists all of it
        return
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            shown = {anchor.rpartition(".")[2] for anchor in re.findall(r'<h\d id="([\w.]+)"', html)}
            if lost := set(ast.literal_eval(node.value)) - shown:
                log.warning("%s: not in the reference: %s", page.file.src_uri, ", ".join(sorted(lost)))
