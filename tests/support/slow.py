"""Cases of which some are slow tests."""

import pytest


def first_fast(cases, count=1):
    """Return cases for `parametrize` of which those after the first ``count`` are slow tests."""
    cases = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*case, marks=pytest.mark.slow if i >= count else ()) for i, case in enumerate(cases)]
