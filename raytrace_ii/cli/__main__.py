"""``python -m raytrace_ii.cli``."""

from . import main

main()
