"""README, CHANGELOG and docs/: links, command lines, Python examples, names.

Every block of ```python runs, top to bottom of its page with one set of names, in a folder that holds a small
``apples.png``, its coding ``apples.ii`` and ``decoded.png``. Python that is not to run is written without the word.
"""

import importlib.util
import itertools
import math
import os
import re
import shlex
import shutil
from dataclasses import fields
from pathlib import Path

import pytest
import typer

import codec
import ii_core
import metrics
import raytrace_ii
from benchmarks.pages.cameras import KINDS as GROUPS
from benchmarks.registry import BENCHMARKS
from codec import decode, encode
from ii_core import IICamera, camera_names, panel_display
from ii_core.camera.optics import KINDS, LensModel
from raytrace_ii.cli import app
from tests.support.slow import first_fast

ROOT = Path(__file__).parents[2]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md")))
}
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
COMMANDS = typer.main.get_command(app).commands


def python_blocks(text):
    return [code for language, code in FENCED.findall(text) if language == "python"]


def prose(text):
    """The text without blocks and spans of code."""
    return re.sub(r"`[^`\n]+`", "", re.sub(r"^    .*$", "", FENCED.sub("", text), flags=re.M))


def anchors(text):
    """Return the anchors of headings, as code hosts and our site name them."""
    heads = re.findall(r"^#+ (.+)$", FENCED.sub("", text), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_and_headings_that_are_there(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(PAGES[page])):
        if re.match(r"https?://", target):
            continue
        file, _, anchor = target.partition("#")
        path = (ROOT / page).parent / file if file else ROOT / page
        assert path.exists(), f"{page}: {target}: no such file"
        if anchor:
            assert anchor in anchors(path.read_text(encoding="utf-8")), f"{page}: {target}: no such heading"


def written_commands(text):
    """Command lines in blocks, and fragments in running text, each with whether it is whole."""
    blocks = [line.strip() for line in re.findall(r"^    .*$", text, re.M)]
    blocks += [line.strip() for _, code in FENCED.findall(text) for line in code.splitlines()]
    for line in blocks:
        if line.startswith("raytrace-ii "):
            yield re.split(r"\s{2,}|\s#", line)[0], True
    for span in re.findall(r"`(raytrace-ii [^`]+)`", re.sub(r"^    .*$", "", FENCED.sub("", text), flags=re.M)):
        yield " ".join(span.split()), False


def variants(line):
    """``a | b`` is one or the other; what stands in brackets may be given."""
    words, choices = shlex.split(re.sub(r"[\[\]]", "", line))[1:], []
    for i, word in enumerate(words):
        if word == "|":
            continue
        if i and words[i - 1] == "|":
            choices[-1].append(word)
        else:
            choices.append([word])
    return [list(words) for words in itertools.product(*choices)]


def test_variants_of_a_line():
    assert variants("raytrace-ii export a.png --to views | hci [-o B]") == [
        ["export", "a.png", "--to", "views", "-o", "B"],
        ["export", "a.png", "--to", "hci", "-o", "B"],
    ]


def complaint(words, whole):
    """Return the command's error on these words, or None; checks options and counts, not files and values."""
    name, *rest = words
    if name == "COMMAND":
        return None
    if name not in COMMANDS:
        return f"no command {name!r}"
    try:
        COMMANDS[name].make_context(name, [word for word in rest if word != "--help"])
    except typer.exceptions.TyperException as error:
        missing = type(error).__name__ == "MissingParameter"
        return None if missing and not whole else error.format_message()
    return None


def test_the_check_of_commands_finds_what_is_wrong():
    assert complaint(["render", "apples", "-o", "a.png"], True) is None
    assert complaint(["render", "--dask", "HOST:PORT"], False) is None
    assert "-o" in complaint(["render", "apples"], True)
    assert "--scales" in complaint(["render", "--scales", "8"], False)
    assert "integer" in complaint(["render", "apples", "-o", "a.png", "--scale", "x"], True)
    assert "rendr" in complaint(["rendr"], False)


@pytest.mark.parametrize("page", PAGES)
def test_commands_parse(page):
    for line, whole in written_commands(PAGES[page]):
        for words in variants(line):
            assert complaint(words, whole) is None, f"{page}: {line}"


def test_commands_are_found():
    """The README shows ten command lines; one page has every command."""
    assert sum(whole for _, whole in written_commands(PAGES["README.md"])) == 10
    found = [line for line, _ in written_commands(PAGES["docs/commands.md"])]
    assert {words[0] for line in found for words in variants(line)} >= COMMANDS.keys()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small picture and its coding, under the names that pages use."""
    folder = tmp_path_factory.mktemp("docs")
    picture = raytrace_ii.render(raytrace_ii.load_scene("apples"), ii_core.preset("setup1", scale=32)).picture
    picture.save(folder / "apples.png")
    coded = encode(picture, "si-h264", qp=30)
    coded.save(folder / "apples.ii")
    decode(coded).save(folder / "decoded.png")
    return folder


@pytest.mark.parametrize("page", first_fast(page for page, text in PAGES.items() if python_blocks(text)))
def test_python_runs(page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    names = {"__name__": page}
    for code in python_blocks(PAGES[page]):
        line = PAGES[page][: PAGES[page].index(code)].count("\n")
        exec(compile("\n" * line + code, page, "exec"), names)


@pytest.mark.parametrize("page", PAGES)
def test_scripts_and_targets_exist(page):
    for name in re.findall(r"\b(?:benchmarks|examples)\.[a-z_]+(?:\.[a-z_]+)*", PAGES[page]):
        assert importlib.util.find_spec(name), f"{page}: {name}"
    for name in re.findall(r"python\s+-m\s+benchmarks\s+run\s+(\w+)", PAGES[page]):
        assert name in BENCHMARKS or name == "NAME", f"{page}: python -m benchmarks run {name}"
    assert not re.search(r"python\s+-m\s+benchmarks\.", PAGES[page]), f"{page}: type python -m benchmarks run NAME"
    for path in re.findall(r"(?<![\w/])(?:benchmarks|examples)/[\w/]+\.py", PAGES[page]):
        assert (ROOT / path).is_file(), f"{page}: {path}"
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    for name in re.findall(r"`make ([a-z]+)`|^    make ([a-z]+)", PAGES[page], re.M):
        assert "".join(name) in targets, f"{page}: make {''.join(name)}"


def test_every_page_is_in_the_site():
    config = (ROOT / "docs" / "site" / "mkdocs.yml").read_text(encoding="utf-8")
    pages = {os.path.relpath(page, "docs") for page in PAGES if page.startswith("docs/")}
    assert set(re.findall(r": (\S+\.md)$", config, re.M)) == pages


@pytest.mark.parametrize("package", [ii_core, raytrace_ii, codec, metrics])
def test_every_public_name_has_a_docstring(package):
    """The reference shows no name without a docstring."""
    public = {name: getattr(package, name) for name in package.__all__}
    assert not [name for name, value in public.items() if callable(value) and not value.__doc__]


@pytest.mark.parametrize(("page", "most"), [("README.md", 1100), ("CHANGELOG.md", 400)])
def test_the_first_pages_are_short(page, most):
    """A stranger reads them in minutes; what is longer has a page of its own."""
    assert len(PAGES[page].split()) <= most


@pytest.mark.parametrize("page", PAGES)
def test_text_is_wrapped_at_100_columns(page):
    """But for tables, headings and pictures, which are lines of their own."""
    text = re.sub(r"^    .*$", "", FENCED.sub("", PAGES[page]), flags=re.M)
    assert [line for line in text.split("\n") if len(line) > 100 and not re.match(r" *[|#<]|!\[", line)] == []


# -- pages of cameras: every key, element and camera, and the numbers of the worked display


DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "camera_files.md").read_text(encoding="utf-8")
ITEMS = dict(re.findall(r"^- (?:\*\*)?`([\w-]+)[^`]*`((?:.|\n(?=  ))*)", PAGE, re.M))  # text by key


def test_every_key_of_a_camera_file_has_an_item():
    keys = {field.name for field in fields(IICamera)} - {"name"}
    assert keys <= set(ITEMS) and "`name`" in PAGE and "`about`, `notes`" in PAGE


def test_every_element_has_an_item_with_its_parameters():
    for kind, element in KINDS.items():
        for field in fields(element):
            assert f"`{field.name}`" in ITEMS[kind], f"{kind}: {field.name}"
    models = PAGE[PAGE.index("## Optical elements") : PAGE.index("Elements in front")]
    assert {kind for kind, element in KINDS.items() if issubclass(element, LensModel)} == set(
        re.findall(r"^- `([\w-]+)`", models, re.M)
    )


def test_the_worked_display_is_the_design():
    made = panel_display(size_mm=15.6 * 25.4, pixels=(3840, 2160), lens_pitch_mm=1.0, viewer_mm=600)
    camera = made.camera
    across, down = camera.lenses
    numbers = {
        f"{camera.pixel_pitch_mm:.4f} mm", f"{across}×{down} lenses", f"{camera.ei_pitch_mm[0]:.4f} mm",
        f"{camera.lens_pitch_mm[0]:.4f} mm", f"{camera.gap_mm:.3f} mm",
        f"{camera.ei_pitch_mm[0] * 600 / camera.gap_mm:.1f} mm",
    }  # fmt: skip
    for number in numbers:
        assert number in " ".join(PAGE.split()), number
    assert math.isclose(camera.view_angle_deg, 30)


def test_every_camera_is_on_its_page_once():
    named = [name for names in GROUPS.values() for name in names]
    assert sorted(named) == sorted(name for name in camera_names() if not name.startswith("setup2"))
    text = (DOCS / "cameras.md").read_text(encoding="utf-8")
    assert re.findall(r"^### (\S+)$", text, re.M) == named
    assert [kind for kind in re.findall(r"^## (.+)$", text, re.M) if kind in GROUPS] == list(GROUPS)


# -- the site of docs/: a small tree with our hook, built strictly by MkDocs (skipped without the extra ``docs``)


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
