"""Identity of code: hash of sources, versions of libraries."""

from __future__ import annotations

import hashlib
import importlib.util
import platform
from collections.abc import Sequence
from functools import lru_cache
from importlib import metadata
from pathlib import Path

# Libraries that results depend on, without those of command line, charts and validation messages.
LIBRARIES = (
    "numpy", "numba", "embreex", "trimesh", "OpenImageIO", "scikit-image", "scipy", "av", "pillow", "imagecodecs",
    "bjontegaard",
)  # fmt: skip


def source_hash(packages: Sequence[str], endings: Sequence[str] = (".py",)) -> str:
    """Return the SHA-256 of the files of packages on disk.

    Parameters
    ----------
    packages : sequence of str
        Names of packages, which are not imported.
    endings : sequence of str
        Suffixes of the hashed files.

    Raises
    ------
    ModuleNotFoundError
        If a package does not exist.
    """
    digest = hashlib.sha256()
    for package in packages:
        found = importlib.util.find_spec(package)
        if found is None or not found.submodule_search_locations:
            raise ModuleNotFoundError(f"there is no package {package}")
        folder = Path(found.submodule_search_locations[0])
        for path in sorted(folder.rglob("*")):
            if path.suffix in endings and path.is_file():
                digest.update(f"{package}/{path.relative_to(folder).as_posix()}\0".encode())
                digest.update(_file_hash(path, path.stat().st_mtime_ns))
    return digest.hexdigest()


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@lru_cache(maxsize=4096)
def _file_hash(path: Path, _changed: int) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def library_versions(libraries: Sequence[str] = LIBRARIES) -> dict[str, str]:
    """Return the versions of Python, of this distribution and of the installed ones among libraries."""
    found = {"python": platform.python_version()}
    for library in ("raytrace-ii", *libraries):
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
