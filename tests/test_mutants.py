"""The list of mutants: every place stands once in its file, and its tests are there."""

import pytest

from tests.support.mutants import ROOT, mutants


@pytest.mark.parametrize("file", sorted({mutant.file for mutant in mutants()}))
def test_every_mutant_changes_one_place(file):
    text = (ROOT / file).read_text(encoding="utf-8")
    for mutant in mutants(file):
        assert text.count(mutant.old) == 1, f"{file}: {mutant.old}"
        assert mutant.new not in ("", mutant.old)
        compile(text.replace(mutant.old, mutant.new), file, "exec")
        assert all((ROOT / path).exists() for path in mutant.tests)
