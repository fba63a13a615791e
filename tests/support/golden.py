"""Archives of frozen files in ``tests/golden``: they hold later versions to decode what earlier ones wrote.

``coders.zip`` has one file a scheme, ``SCHEME.ii``, and the pixels that it decodes to, ``SCHEME.png``: coded once by
the version that introduced the scheme, and never replaced; ``compact-header`` and ``first-header`` hold both headers.
``pytest -n 0 tests/codec/test_golden.py --make-golden`` adds those of new schemes, and to ``defaults.json`` every
option's default, which files leave out. ``lf.zip`` has streams of `si-lf` of versions 3 to 12.
"""

import atexit
import shutil
import tempfile
import zipfile
from functools import cache
from pathlib import Path


@cache
def unpacked(name: str) -> Path:
    """Return a folder with the files of an archive of ``tests/golden``; it is removed when Python ends."""
    folder = Path(tempfile.mkdtemp(prefix="golden-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    with zipfile.ZipFile(Path(__file__).parents[1] / "golden" / name) as archive:
        archive.extractall(folder)
    return folder
