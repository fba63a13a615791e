"""What the site does to the pages of docs/, so that the same pages read well in the repository.

A link out of docs/, to a script or to measured numbers, leads to that file: the site carries it along.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OUTWARD = re.compile(r"\]\((?P<path>(?:\.\./)+[^)#\s]+)")


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

    return OUTWARD.sub(inside, markdown)
