"""Products of a manifest: files of one render with hashes of inputs and content."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ii_core.base.files import read_json
from ii_core.base.identity import file_hash

from .render import Stats


@dataclass(frozen=True)
class Product:
    """Files that are rendered together, and the hash of all their inputs."""

    files: tuple[Path, ...]
    key: str
    make: Callable[..., Stats]


def read_manifest(path: Path, form: str, what: str, name: str) -> dict[str, Any]:
    """Return a manifest; empty if there is none.

    Parameters
    ----------
    form, what, name : str
        Value of the key ``format``, and key and value of the manifest's subject: ``"set", "reference"``.

    Raises
    ------
    ValueError
        If the file is not the manifest of this subject.
    """
    if not path.exists():
        return {}
    manifest = read_json(path)
    if not isinstance(manifest, dict) or manifest.get("format") != form or manifest.get(what) != name:
        raise ValueError(f"{path} is not the manifest of the {what} {name!r}: another folder is needed")
    return manifest


def is_product(record: Any) -> bool:
    """Return whether a value of a manifest is the record of a product: its key, and size and hash of its files."""
    return (
        isinstance(record, dict)
        and isinstance(record.get("key"), str)
        and isinstance(record.get("files"), dict)
        and all(isinstance(file, dict) and {"bytes", "sha256"} <= set(file) for file in record["files"].values())
    )


def damaged(path: Path) -> ValueError:
    """Return the error of a manifest with values of wrong types."""
    return ValueError(f"{path} is damaged: remove it, and give --force to make its files again")


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
    """Return a product's record in a manifest."""
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
    """Return whether all files exist, unchanged, and were made of the same inputs."""
    if record is None or record.get("key") != product.key:
        return False
    return all(is_same(path, record["files"].get(path.name)) for path in product.files)


def is_same(path: Path, fingerprint: Any) -> bool:
    """Return whether a file exists with this size and hash."""
    if not fingerprint or not path.is_file() or path.stat().st_size != fingerprint["bytes"]:
        return False
    return file_hash(path) == fingerprint["sha256"]


def commit() -> str | None:
    """Return the commit of the running source; None if it was installed."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    try:
        found = subprocess.run(["git", "-C", root, "rev-parse", "HEAD"], capture_output=True, text=True)
    except OSError:
        return None
    return found.stdout.strip() or None
