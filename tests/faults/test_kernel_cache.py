"""Cache of compiled kernels: kernels run with any content of the cache, which is repaired.

A module imported anew has new kernels, which read the cache as those of a new process do.
"""

import ast
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from ii_core.base import jit

ROOT = Path(__file__).parents[2]
FOLDERS = ("old", "new", "far", "between", "near")  # packages that tests make

KERNEL = """
from ii_core.base.jit import kernel

@kernel
def doubled(x):
    return 2 * x
"""
CALL = """
import importlib, sys
found = importlib.import_module(sys.argv[1])
print(found.doubled(21), len(found.doubled.stats.cache_hits))
"""


def called_in_a_process(folder, module):
    """Return what a kernel gives in a new process, and the number of its cache hits."""
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", ""), os.getcwd()])
    done = subprocess.run(
        [sys.executable, "-c", CALL, module],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": ""},
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    value, hits = done.stdout.rsplit(maxsplit=1)
    return ast.literal_eval(value), int(hits)


@pytest.fixture
def called(monkeypatch, recwarn, capfd):
    """A function that returns what a kernel of a newly imported module gives, and the number of its cache hits."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two edits within a second would have one time stamp

    def call(folder, module):
        for name in [name for name in sys.modules if name.partition(".")[0] in FOLDERS]:
            del sys.modules[name]
        with monkeypatch.context() as here:
            here.syspath_prepend(folder)
            jit._STAMPS.clear()
            jit._source.cache_clear()
            doubled = importlib.import_module(module).doubled
            found = doubled(21), len(doubled.stats.cache_hits)
        assert not recwarn.list and capfd.readouterr() == ("", "")
        return found

    return call


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A package with a kernel that a process has compiled and kept."""
    folder = tmp_path_factory.mktemp("kept")
    (folder / "old").mkdir()
    (folder / "old" / "__init__.py").write_text("")
    (folder / "old" / "kernels.py").write_text(KERNEL)
    assert called_in_a_process(folder, "old.kernels") == (42, 0)
    assert called_in_a_process(folder, "old.kernels") == (42, 1), "it is kept"
    return folder


@pytest.fixture
def package(kept, tmp_path):
    """A copy of it."""
    return shutil.copytree(kept, tmp_path / "copy")


@pytest.mark.slow
def test_a_copied_cache_is_read(called, package):
    assert called(package, "old.kernels") == (42, 1)


@pytest.mark.slow
@pytest.mark.parametrize("end", ["nbi", "nbc"])
@pytest.mark.parametrize("cut", [0, 1, 30, 0.5, 0.95])
def test_a_file_cut_short_is_made_again(called, package, end, cut):
    (file,) = (package / "old" / "__pycache__").glob(f"*.{end}")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(cut * len(whole)) if isinstance(cut, float) else cut])
    assert called(package, "old.kernels") == (42, 0)
    assert called(package, "old.kernels") == (42, 1)


@pytest.mark.slow
def test_a_renamed_folder(package):
    """The cache names missing modules, but the time stamp of the source file, which numba checks, is unchanged."""
    (package / "old").rename(package / "new")
    assert called_in_a_process(package, "new.kernels")[0] == 42
    assert called_in_a_process(package, "new.kernels") == (42, 1)


@pytest.mark.slow
def test_foreign_files(called, package):
    for file in (package / "old" / "__pycache__").glob("*.nb?"):
        file.write_bytes(b"\x80\x05cos\nabsent\n.")
    assert called(package, "old.kernels") == (42, 0)


@pytest.mark.slow
def test_a_cache_that_cannot_be_written(package):
    limited = package / "limited.py"
    limited.write_text("import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n" + KERNEL)
    assert called_in_a_process(package, "limited") == (42, 0)


@pytest.mark.slow
def test_an_edit_of_a_file_beside_it(called, package):
    """A kernel may call a kernel of another file in its folder; numba's own cache would keep the old copy."""
    (package / "old" / "twice.py").write_text(KERNEL.replace("doubled", "twice"))
    (package / "old" / "kernels.py").write_text(
        "from ii_core.base.jit import kernel\nfrom .twice import twice\n\n"
        "@kernel\ndef doubled(x):\n    return twice(x)\n"
    )
    assert called(package, "old.kernels") == (42, 0)
    assert called(package, "old.kernels") == (42, 1)
    (package / "old" / "twice.py").write_text(KERNEL.replace("doubled", "twice").replace("2 * x", "3 * x"))
    assert called(package, "old.kernels") == (63, 0)
    assert called(package, "old.kernels") == (63, 1)


def test_an_edit_of_a_file_in_another_folder(called, tmp_path):
    """A coder's kernels call the arithmetic coder of another folder, by way of any number of files."""
    for folder, text in (
        ("far", KERNEL.replace("doubled", "twice")),
        ("between", "from far.kernels import twice\n" + KERNEL.replace("2 * x", "twice(x)")),
        ("near", "from between.kernels import doubled as same\n" + KERNEL.replace("2 * x", "same(x)")),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("")
        (tmp_path / folder / "kernels.py").write_text(text)
    assert called(tmp_path, "near.kernels") == (42, 0)
    assert called(tmp_path, "near.kernels") == (42, 1)
    source = tmp_path / "far" / "kernels.py"
    source.write_text(source.read_text().replace("2 * x", "3 * x"))
    assert called(tmp_path, "near.kernels") == (63, 0)
    assert called(tmp_path, "near.kernels") == (63, 1)


@pytest.mark.slow
@pytest.mark.parametrize("edited", ["ii_core/base/jit.py", "codec/coders/lf/contexts.py"])
def test_an_edit_of_a_file_without_kernels(tmp_path, edited):
    """The way kernels are compiled, and constants in their code, for kernels of a coder."""
    for folder in ("ii_core", "codec"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    kernel = KERNEL.replace("2 * x", "unpacked(x)")
    (tmp_path / "calls.py").write_text("from codec.coders.lf.motion import unpacked\n" + kernel)
    assert called_in_a_process(tmp_path, "calls")[-1] == 0
    assert called_in_a_process(tmp_path, "calls")[-1] == 1
    with (tmp_path / edited).open("a") as file:
        file.write("\n# edited\n")
    assert called_in_a_process(tmp_path, "calls")[-1] == 0
