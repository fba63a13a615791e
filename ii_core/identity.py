"""Identity of the code that makes a number or a picture: hash of its sources, versions of its libraries."""

from __future__ import annotations

import hashlib
import importlib.util
import platform
from collections.abc import Sequence
from functools import lru_cache
from importlib import metadata
from pathlib import Path

# All that results depend on; command line, charts and validation messages are left out.
LIBRARIES = (
    "numpy", "numba", "embreex", "trimesh", "OpenImageIO", "scikit-image", "scipy", "av", "pillow", "imagecodecs",
    "bjontegaard",
)  # fmt: skip


def source_hash(packages: Sequence[str], endings: Sequence[str] = (".py",)) -> str:
    """Return the SHA-256 of the files of packages as they are on disk now.

    Parameters
    ----------
    packages : sequence of str
        Names; they are found, not imported.
    endings : sequence of str
        Kinds of files that count.

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


@lru_cache(maxsize=4096)
def _file_hash(path: Path, _changed: int) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def library_versions(libraries: Sequence[str] = LIBRARIES) -> dict[str, str]:
    """Return the versions of Python, of this distribution and of libraries, as far as they are installed."""
    found = {"python": platform.python_version()}
    for library in ("raytrace-ii", *libraries):
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
