"""Tables for a terminal of any width: columns that do not fit continue in a further table below."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from .progress import console
from .words import one_line, say

FRAME = 3  # characters of a column beside its text: a line and two spaces


def print_table(title: str, rows: Sequence[Mapping[str, str]], *, names: int = 1) -> None:
    """Print rows of equal columns; no cell is cut or wrapped.

    Parameters
    ----------
    title : str
    rows : sequence of mapping
        Texts by column, at least one row.
    names : int
        Number of columns that name a row: left-aligned, and repeated in every part of the table.
    """
    from rich.table import Table

    cells = [{one_line(key): one_line(value) for key, value in row.items()} for row in rows]
    widths = {column: FRAME + max(len(column), *(len(row[column]) for row in cells)) for column in cells[0]}
    screen = console().width
    say(title)
    for part in _parts(widths, names, screen):
        table = Table()
        for number, column in enumerate(part):
            table.add_column(column, justify="left" if number < names else "right", no_wrap=True)
        for row in cells:
            table.add_row(*(row[column] for column in part))
        console(width=max(screen, 1 + sum(widths[column] for column in part))).print(table)


def _parts(widths: Mapping[str, int], names: int, screen: int) -> Iterator[list[str]]:
    """Yield the columns of each part: the names, and as many others as fit, at least one."""
    naming, others = list(widths)[:names], list(widths)[names:]
    base = 1 + sum(widths[column] for column in naming)
    part: list[str] = []
    for column in others:
        if part and base + sum(widths[each] for each in [*part, column]) > screen:
            yield [*naming, *part]
            part = []
        part.append(column)
    yield [*naming, *part]
