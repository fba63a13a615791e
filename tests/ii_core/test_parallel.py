"""Work on rows shared among threads: every row once, errors raised, ranges at multiples of a step."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ii_core.base.parallel import cores, over_rows


@given(rows=st.integers(0, 300), workers=st.integers(-1, 40), step=st.integers(1, 70))
def test_every_row_is_in_one_range_that_starts_at_a_multiple_of_the_step(rows, workers, step):
    ranges = []
    over_rows(lambda first, last: ranges.append((first, last)), rows, workers=workers, step=step)
    ranges.sort()
    assert [row for first, last in ranges for row in range(first, last)] == list(range(rows))
    assert all(first % step == 0 for first, _ in ranges) and len(ranges) <= max(1, workers)


def test_an_error_in_one_range_is_raised():
    def work(first, last):
        if first:
            raise OSError(f"row {first}")

    with pytest.raises(OSError, match="row 5"):
        over_rows(work, 10, workers=2)


def test_one_thread_per_core_and_none_extra_for_one_range():
    meeting, names = threading.Barrier(cores(), timeout=20), set()

    def work(first, last):
        meeting.wait()  # all ranges at once, or the barrier breaks
        names.add(threading.get_ident())

    over_rows(work, 64)
    assert len(names) == cores()
    over_rows(lambda first, last: names.add(threading.get_ident()), 64, workers=1)
    assert threading.get_ident() in names
