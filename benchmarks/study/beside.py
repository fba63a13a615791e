"""Tables of our numbers beside those of the dissertation, one for each part of the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from . import theirs
from .claims import MODEL_TIME, Claim
from .coding import SCENES
from .rates import RANGES
from .theirs import said


def tables(made: Sequence[Claim]) -> dict[str, list[str]]:
    """Return the table of each part by its mark."""
    return {
        "claims-rates": rates(of("5.10", made)),
        "claims-orders": orders(of("5.11", made)),
        "claims-structures": by_scene(of("5.12", made), list(theirs.DUELS)),
        "claims-ranges": by_scene(of("Table 5.6", made), [str(r) for r in RANGES[1:]]),
        "claims-control": by_scene(of("Table 5.7", made), ["cq", "2pass", "crf"]),
        "claims-times": times(of("Table 5.8", made)),
        "claims-views": views(of("5.19", made)),
        "claims-layers": layers(of("5.21", made)) + rates_of_28_db(of("5.20", made)),
        "claims-depths": by_what(of("5.23", made)),
    }


def of(figure: str, made: Iterable[Claim]) -> list[Claim]:
    """Return the claims of a figure."""
    return [claim for claim in made if claim.figure == figure]


def grid(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a Markdown table, or nothing without rows."""
    body = [f"| {' | '.join(row)} |" for row in rows]
    return [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *body] if body else []


def cell(name: str, *some: Claim) -> str:
    """Return the dissertation's number of a name, then ours of each claim."""
    if not any(name in claim.ours for claim in some):
        return ""
    first = [some[0].theirs.get(name, "–")] if some[0].theirs else []
    return " · ".join([*first, *(claim.ours[name] for claim in some)])


def rates(made: Sequence[Claim]) -> list[str]:
    """Return leads and ratios by scene, 4:2:0 and 4:4:4 in one row, and the lowest rate of EI-PVS."""
    wide = [claim for claim in made if claim.ours.keys() <= set(SCENES)]
    rows = [
        [what, *(cell(scene, *(claim for claim in wide if claim.what == what)) for scene in SCENES)]
        for what in dict.fromkeys(claim.what for claim in wide)
    ]
    least = [
        f"{claim.what[0].upper()}{claim.what[1:]}, by {name}: {claim.theirs[name]} · {text}."
        for claim in made
        for name, text in claim.ours.items()
        if claim not in wide
    ]
    lines = grid(["", *SCENES], rows)
    return [*lines, *([""] if lines and least else []), *least]


def orders(made: Sequence[Claim]) -> list[str]:
    """Return the dB of each order against parallel."""
    names = [name for name in theirs.ORDERS if name != "parallel"]
    rows = [[c.scene, *(c.ours[name] for name in names), said(*c.verdict.order)] for c in made]
    return grid(["", *names, "order agrees"], rows)


def by_scene(made: Sequence[Claim], names: Sequence[str]) -> list[str]:
    """Return a row for each claim, a column for each name."""
    whats = len({claim.what for claim in made}) > 1
    rows = [[f"{c.scene}, {c.what}" if whats else c.scene, *(cell(name, c) for name in names)] for c in made]
    return grid(["", *names], rows)


def times(made: Sequence[Claim]) -> list[str]:
    """Return the times by scene, and those of the verification model in a column of their own."""
    model = [claim for claim in made if claim.what == MODEL_TIME]
    rest = [claim for claim in made if claim.what != MODEL_TIME]
    names = list(rest[0].ours) if rest else []
    rows = [[c.scene, *(cell(name, c) for name in names), *(cell(c.scene, m) for m in model)] for c in rest]
    return grid(["", *names, *([MODEL_TIME] if model else [])], rows)


def views(made: Sequence[Claim]) -> list[str]:
    """Return the dissertation's ranks of Q_view, and how many of ours agree."""
    rows = []
    for c in made:
        ranks = " > ".join(" = ".join(names) for names in theirs.VIEW_PLACES[c.scene])
        rows.append([c.scene, ranks, said(*c.verdict.order)])
    return grid(["", "dissertation", "order agrees"], rows)


def layers(made: Sequence[Claim]) -> list[str]:
    """Return decline and fluctuation of Q_depth by scene, true depth and depth by focus."""
    return by_what(made, names={"decline": theirs.DECLINE, "fluctuation": theirs.FLUCTUATION})


def rates_of_28_db(made: Sequence[Claim]) -> list[str]:
    """Return a sentence with the rates at equal quality."""
    return [
        line
        for c in made
        for line in ("", f"{c.what}, {c.scene}: " + ", ".join(f"{name} {cell(name, c)}" for name in c.ours) + ".")
    ]


def by_what(made: Sequence[Claim], names: Mapping[str, Iterable[str]] | None = None) -> list[str]:
    """Return a row for each scene, a column for each quantity; its head lists the names of its numbers."""
    whats = list(dict.fromkeys(claim.what for claim in made))
    there = {(claim.scene, claim.what): " · ".join(claim.ours.values()) for claim in made}
    heads = [what + (f": {' · '.join(names[what.partition(',')[0]])}" if names else "") for what in whats]
    scenes = dict.fromkeys(claim.scene for claim in made)
    return grid(["", *heads], ([scene, *(there.get((scene, what), "") for what in whats)] for scene in scenes))
