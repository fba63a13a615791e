"""Cache of compiled kernels: kernels run with any content of the cache, which is repaired."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

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


def call(folder, module, **environment):
    done = subprocess.run(
        [sys.executable, "-c", CALL, module],
        capture_output=True,
        text=True,
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", ""), os.getcwd()]),
        }
        | environment,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.split()


@pytest.fixture
def package(tmp_path):
    """A package with a kernel that has been compiled and kept."""
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "__init__.py").write_text("")
    (tmp_path / "old" / "kernels.py").write_text(KERNEL)
    assert call(tmp_path, "old.kernels") == ["42", "0"]
    assert call(tmp_path, "old.kernels") == ["42", "1"], "it is kept"
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("end", ["nbi", "nbc"])
@pytest.mark.parametrize("cut", [0, 1, 30, 0.5, 0.95])
def test_a_file_cut_short_is_made_again(package, end, cut):
    (file,) = (package / "old" / "__pycache__").glob(f"*.{end}")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(cut * len(whole)) if isinstance(cut, float) else cut])
    assert call(package, "old.kernels") == ["42", "0"]
    assert call(package, "old.kernels") == ["42", "1"]


@pytest.mark.slow
def test_a_renamed_folder(package):
    """The cache names missing modules, but the time stamp of the source file, which numba checks, is unchanged."""
    (package / "old").rename(package / "new")
    assert call(package, "new.kernels")[0] == "42"
    assert call(package, "new.kernels") == ["42", "1"]


def test_foreign_files(package):
    for file in (package / "old" / "__pycache__").glob("*.nb?"):
        file.write_bytes(b"\x80\x05cos\nabsent\n.")
    assert call(package, "old.kernels") == ["42", "0"]


def test_a_cache_that_cannot_be_written(package):
    limited = package / "limited.py"
    limited.write_text("import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n" + KERNEL)
    assert call(package, "limited") == ["42", "0"]


def test_an_edit_of_a_file_beside_it(package):
    """A kernel may call a kernel of another file in its folder; numba's own cache would keep the old copy."""
    (package / "old" / "twice.py").write_text(KERNEL.replace("doubled", "twice"))
    (package / "old" / "kernels.py").write_text(
        "from ii_core.base.jit import kernel\nfrom .twice import twice\n\n"
        "@kernel\ndef doubled(x):\n    return twice(x)\n"
    )
    assert call(package, "old.kernels") == ["42", "0"]
    assert call(package, "old.kernels") == ["42", "1"]
    (package / "old" / "twice.py").write_text(KERNEL.replace("doubled", "twice").replace("2 * x", "3 * x"))
    assert call(package, "old.kernels") == ["63", "0"]
    assert call(package, "old.kernels") == ["63", "1"]


def test_an_edit_of_a_file_in_another_folder(package):
    """A coder's kernels call the arithmetic coder of another folder, by way of any number of files."""
    for folder, text in (
        ("far", KERNEL.replace("doubled", "twice")),
        ("between", "from far.kernels import twice\n" + KERNEL.replace("2 * x", "twice(x)")),
        ("near", "from between.kernels import doubled as same\n" + KERNEL.replace("2 * x", "same(x)")),
    ):
        (package / folder).mkdir()
        (package / folder / "__init__.py").write_text("")
        (package / folder / "kernels.py").write_text(text)
    assert call(package, "near.kernels") == ["42", "0"]
    assert call(package, "near.kernels") == ["42", "1"]
    source = package / "far" / "kernels.py"
    source.write_text(source.read_text().replace("2 * x", "3 * x"))
    assert call(package, "near.kernels") == ["63", "0"]
    assert call(package, "near.kernels") == ["63", "1"]


@pytest.mark.slow
@pytest.mark.parametrize("edited", ["ii_core/base/jit.py", "codec/coders/lf/contexts.py"])
def test_an_edit_of_a_file_without_kernels(tmp_path, edited):
    """The way kernels are compiled, and constants in their code, for kernels of a coder."""
    for folder in ("ii_core", "codec"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "calls.py").write_text("from codec.coders.lf.motion import unpacked as doubled\n")
    assert call(tmp_path, "calls")[-1] == "0"
    assert call(tmp_path, "calls")[-1] == "1"
    with (tmp_path / edited).open("a") as file:
        file.write("\n# edited\n")
    assert call(tmp_path, "calls")[-1] == "0"
