"""What the site does to the pages of docs/, so that the same pages read well in the repository.

The site has a plain copy of every file outside docs/ that a page links to. A scene of the gallery leads to its viewer
page, if `make gallery` has made it. A public name that the reference lacks is a warning.
"""

from __future__ import annotations

import ast
import logging
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.utils import is_markdown_file

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OUTWARD = re.compile(r"\]\((?P<path>(?:\.\./)+[^)#\s]+)(?P<anchor>#[^)\s]*)?")
SCENE = re.compile(r"^- (?P<name>\w+)$", re.MULTILINE)
log = logging.getLogger("mkdocs.hooks.docs")


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links to files outside docs/ into links to plain copies in the site.

    Copies of Markdown files end in ``.txt``: MkDocs renders files by their ending, and fails on a page that it meets
    after it has read the others. Anchors are dropped, for plain text has none.
    """

    def inside(match: re.Match[str]) -> str:
        path = (DOCS / page.file.src_uri).parent.joinpath(match["path"]).resolve()
        if not path.is_file() or path.is_relative_to(DOCS) or not path.is_relative_to(ROOT):
            return match[0]  # the build finds out whether that is a dead link
        uri = f"source/{path.relative_to(ROOT).as_posix()}"
        if is_markdown_file(uri):
            uri += ".txt"
        if files.get_file_from_path(uri) is None:
            files.append(File.generated(config, uri, abs_src_path=str(path)))
        return f"]({'../' * page.file.src_uri.count('/')}{uri}"

    if page.file.src_uri == "gallery/README.md":
        markdown = SCENE.sub(linked_scene, markdown)
    return OUTWARD.sub(inside, markdown)


def linked_scene(match: re.Match[str]) -> str:
    """Return an item of the gallery as a link to its viewer page, or as it is if there is no such page."""
    page = f"{match['name']}.html"
    return f"- [{match['name']}]({page})" if (DOCS / "gallery" / page).is_file() else match[0]


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
