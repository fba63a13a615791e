"""Viewer: load time and frame rate of full setup1 in a browser without a screen.

    python -m benchmarks run viewer

A browser and playwright are needed. Frame rates are those of the browser's software renderer, without a graphics
card.
"""

from __future__ import annotations

import json
import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.pages.tables import filled
from benchmarks.records import RESULTS, ROOT
from ii_core import preset
from ii_core.base.files import write_json
from ii_core.display.viewer import write_viewer
from metrics import provenance
from raytrace_ii import load_scene, render

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"]


@contextmanager
def tab(size: dict[str, int]) -> Iterator[Any]:
    """Yield an empty page of a browser without a screen."""
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit(f"no browser is installed: one of {', '.join(BROWSERS)} is needed")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield browser.new_page(viewport=size, reduced_motion="reduce")
        browser.close()


def main() -> None:
    """Measure load time and frame rates of Apples at full setup1."""
    picture = render(load_scene("apples"), preset("setup1"), noise=1.0, support=()).picture
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder, tab({"width": 1400, "height": 800}) as page:
        path = Path(folder) / "page.html"
        started = time.perf_counter()
        size = write_viewer(path, picture)
        rows.append({"what": "writing the page", "value": time.perf_counter() - started, "unit": "s"})
        rows.append({"what": "size of the page", "value": size / 2**20, "unit": "MB"})
        page.add_init_script(FIRST_FRAME)
        page.goto(f"file://{path}")
        page.evaluate("async () => { await ii.ready }")
        loaded = page.evaluate("performance.now()")
        rows.append({"what": "first picture on the screen", "value": page.evaluate("first") / 1000, "unit": "s"})
        rows.append({"what": "all pixels on the card", "value": loaded / 1000, "unit": "s"})
        for what, state in (
            ("frames while turning", {"a": 1}),
            ("frames while turning, aperture 8 px", {"a": 4.5}),
            ("frames while turning, aperture 15 px", {"a": 8}),
        ):
            rates = page.evaluate(TURN, {"f": 4, **state})
            rows.append({"what": what, "value": statistics.median(rates), "unit": "1/s"})
        renderer = page.evaluate(RENDERER)
        version = page.evaluate("navigator.userAgent")
    for row in rows:
        print(f"{row['what']:<40} {row['value']:8.2f} {row['unit']}")
    RESULTS.mkdir(exist_ok=True)
    write_json(RESULTS / "viewer.json", {**provenance(), "renderer": renderer, "browser": version, "rows": rows})
    report(ROOT / "docs" / "viewer.md")


FIRST_FRAME = """
window.first = 0;
const draw = WebGL2RenderingContext.prototype.texImage2D;
WebGL2RenderingContext.prototype.texImage2D = function (...values) {
  if (values.length === 6 && !window.first)  // the preview has come; the next frame shows it
    requestAnimationFrame(() => requestAnimationFrame(() => { window.first = performance.now(); }));
  return draw.apply(this, values);
};
"""
RENDERER = """() => {
  const gl = ii.viewer.field.gl, info = gl.getExtension("WEBGL_debug_renderer_info");
  return info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER); }"""
# Reading a pixel back waits until each frame is finished.
TURN = """state => {
  const v = ii.viewer, rates = [];
  v.set(state);
  v.quick = true;
  for (let i = 0; i < 30; i++) {
    const start = performance.now();
    v.state.x = Math.sin(i / 5);
    v.paint();
    v.field.gl.readPixels(0, 0, 1, 1, v.field.gl.RGBA, v.field.gl.UNSIGNED_BYTE, new Uint8Array(4));
    rates.push(1000 / (performance.now() - start));
  }
  return rates; }"""


def report(page: Path) -> None:
    """Write the numbers into the documentation."""
    data = json.loads((RESULTS / "viewer.json").read_text(encoding="utf-8"))
    lines = ["| *Apples*, full `setup1` | |", "|---|---|"]
    lines += [f"| {row['what']} | {row['value']:.3g} {row['unit']} |" for row in data["rows"]]
    lines += [
        "",
        f"Drawn by {data['renderer']}, on {data['machine']['cpus']} cores, commit {data['git']['commit'][:7]}.",
    ]
    page.write_text(filled(page.read_text(encoding="utf-8"), "viewer", lines), encoding="utf-8")
