"""Tests with observers: their plan, their page for a browser, and the results."""

from .page import Stimulus, write_test
from .plan import Options
from .results import Observer, Results, read_results
from .verdict import Judged, Verdict, verdict

__all__ = ["Judged", "Observer", "Options", "Results", "Stimulus", "Verdict", "read_results", "verdict", "write_test"]
