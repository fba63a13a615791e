"""Study: every figure and table of Olsson 2008 from one command, and further experiments.

    python -m benchmarks run study [--scale N] [--only NAME,...] [--out DIR] [--force] [--list] [--publish]

Each experiment is a few named steps, which can be run alone (``--only rates-apples``, ``--only 'views-*'``). What a
step found is one line of ``DIR/NAME.jsonl``, with commit, machine, versions and parameters; lines are only added. A
step that the same code has done with the same parameters and library versions is skipped; ``--force`` does it again
and says whether pictures and numbers, times aside, came out the same to the bit. ``--publish`` copies what is there
into ``benchmarks/results/study`` and ``docs/images/study`` and fills ``docs/study.md`` from it.
"""
