"""Products of a manifest: files of one render with hashes of inputs and content."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..scene.hashing import file_hash
from .render import Stats


@dataclass(frozen=True)
class Product:
    """Files that are made together, and all that they depend on."""

    files: tuple[Path, ...]
    key: str
    make: Callable[..., Stats]


@contextmanager
def manifest_kept_if_used(manifest: Path) -> Iterator[None]:
    """Remove a new manifest if the block fails before it has made any other file in the folder."""
    before = {*manifest.parent.iterdir(), manifest}
    new = not manifest.exists()
    try:
        yield
    except BaseException:
        if new and before.issuperset(manifest.parent.iterdir()):
            manifest.unlink(missing_ok=True)
        raise


def record_of(product: Product, stats: Stats) -> dict[str, Any]:
    """Return what a manifest keeps of a product."""
    return {
        "key": product.key,
        "files": {path.name: fingerprint(path) for path in product.files},
        "seconds": round(stats.seconds, 3),
        "cpu_seconds": round(stats.cpu_seconds, 3),
        "rays": stats.rays,
        "skipped": stats.skipped,
        "samples": {str(n): pixels for n, pixels in stats.samples.items()},
    }


def fingerprint(path: Path) -> dict[str, Any]:
    """Return size and hash of a file."""
    return {"bytes": path.stat().st_size, "sha256": file_hash(path)}


def is_done(product: Product, record: dict[str, Any] | None) -> bool:
    """Whether all files are there, the very ones, made of the very same."""
    if record is None or record.get("key") != product.key:
        return False
    return all(is_same(path, record["files"].get(path.name)) for path in product.files)


def is_same(path: Path, fingerprint: Any) -> bool:
    """Whether a file is there with this size and hash."""
    if not fingerprint or not path.is_file() or path.stat().st_size != fingerprint["bytes"]:
        return False
    return file_hash(path) == fingerprint["sha256"]


def commit() -> str | None:
    """The commit of the source that runs; None if it was installed."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    try:
        found = subprocess.run(["git", "-C", root, "rev-parse", "HEAD"], capture_output=True, text=True)
    except OSError:
        return None
    return found.stdout.strip() or None
