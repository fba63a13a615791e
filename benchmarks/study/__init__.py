"""Study: every figure and table of Olsson 2008 from one command, and further experiments.

    python -m benchmarks run study [--scale N] [--only NAME,...] [--out DIR] [--force] [--list] [--publish]

An experiment is a few named steps, which can be run alone (``--only rates-apples``, ``--only 'views-*'``). The result
of a step is one line of ``DIR/NAME.jsonl`` with commit, machine, versions and parameters; lines are only appended. A
step is skipped if it has a result of the same code, parameters and library versions. ``--force`` repeats it and
reports whether pictures and numbers other than times are bitwise equal. ``--publish`` copies results to
``benchmarks/results/study.jsonl.gz`` and ``docs/images/study`` and fills ``docs/study.md``.
"""
