"""The site of docs/: a small tree with our hook, built strictly by MkDocs (skipped without the extra ``docs``)."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HOOKS = ROOT / "docs" / "site" / "hooks.py"
CONFIG = """
site_name: small
docs_dir: ..
site_dir: ../../out
use_directory_urls: false
exclude_docs: /site/*
hooks: [hooks.py]
theme: {name: mkdocs}
plugins: []
validation: {omitted_files: warn, absolute_links: warn, unrecognized_links: warn, anchors: warn}
"""
# files outside docs/, by what MkDocs could take them for
OUTWARD = ("README.md", "room/README.md", "room/notes.markdown", ".ci/run", "run.py", "page.html", "a.json")


@pytest.fixture
def build(tmp_path):
    """Return a function that builds pages of docs/ and returns the folder of the site."""
    commands = pytest.importorskip("mkdocs.commands.build")
    load_config = pytest.importorskip("mkdocs.config").load_config
    root = tmp_path / "repository"
    for file in OUTWARD:
        path = root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"# Head\n\nThis is {file}; [a link](nowhere.md).\n")
    (root / "docs" / "site").mkdir(parents=True)
    (root / "docs" / "site" / "mkdocs.yml").write_text(CONFIG)
    shutil.copy(HOOKS, root / "docs" / "site")

    def built(pages):
        for name, text in pages.items():
            path = root / "docs" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        commands.build(load_config(str(root / "docs" / "site" / "mkdocs.yml"), strict=True))
        return root / "out"

    return built


def targets(page):
    """Return the relative links of a page's own text, as files."""
    links = re.findall(r'href="([^"#:]*source/[^"]+)"', page.read_text(encoding="utf-8"))
    return [(page.parent / link).resolve() for link in links]


def lines(prefix):
    """Return links to all files outside docs/, with and without an anchor."""
    return "\n\n".join(f"[one]({prefix}{file}) and [two]({prefix}{file}#head)" for file in OUTWARD)


def test_links_out_of_docs_lead_to_plain_copies(build, tmp_path):
    site = build({"index.md": f"# A\n\n{lines('../')}\n", "deep/other.md": f"# B\n\n{lines('../../')}\n"})
    for page in (site / "index.html", site / "deep" / "other.html"):
        found = targets(page)
        assert len(found) == 2 * len(OUTWARD)
        for file, path in zip(OUTWARD, found[::2], strict=True):
            assert path.read_text() == (tmp_path / "repository" / file).read_text()
        assert found[::2] == found[1::2]


def test_a_dead_link_out_of_docs_stops_the_build(build):
    with pytest.raises(BaseException, match="strict mode"):
        build({"index.md": "# A\n\n[gone](../GONE.md)\n"})


def test_scenes_lead_to_pages_that_are_there(build):
    gallery = "# Gallery\n\n- apples\n- car\n"
    pages = {"gallery/car.html": "-"}
    site = build({"index.md": "# A\n\n[gallery](gallery/README.md)\n", "gallery/README.md": gallery, **pages})
    text = (site / "gallery" / "index.html").read_text(encoding="utf-8")
    assert '<a href="car.html">car</a>' in text and "apples.html" not in text
