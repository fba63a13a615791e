"""Progress of commands: bars, closing lines with times, the notice of compilation, and ``--quiet``."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .words import one_line, say

if TYPE_CHECKING:
    from rich.console import Console

Report = Callable[[int, int, str], None]
EVERY_SECONDS = 30.0  # interval of the lines of progress in a log
BAR = 24  # width in characters: title, numbers and times fit 80 columns


@dataclass
class Running:
    """The running command: whether it is quiet, and when it started."""

    quiet: bool = False
    started: float = 0.0
    cpu: float = 0.0


running = Running()


Quiet = Annotated[
    bool, typer.Option("-q", "--quiet", help="No progress and no closing line: only results, warnings and errors.")
]


class App(typer.Typer):
    """Commands that all have the option ``--quiet`` and are timed."""

    def __call__(self, *args: Any, **more: Any) -> Any:
        """Run a command. All are made once, which takes 30 ms: tests run hundreds in one process."""
        return self._group(*args, **more)

    @cached_property
    def _group(self) -> Any:
        return typer.main.get_command(self)

    def command(self, *names: Any, **options: Any) -> Any:
        """Return the decorator of a command."""

        def decorate(function: Callable[..., None]) -> Callable[..., None]:
            @wraps(function)
            def run(*arguments: Any, quiet: bool, **more: Any) -> None:
                from ii_core.base.jit import compilation_told

                running.quiet, running.started, running.cpu = quiet, time.perf_counter(), cpu_seconds()
                try:
                    with compilation_told(_tell_compilation):
                        function(*arguments, **more)
                finally:
                    running.quiet = False

            own = signature(function, eval_str=True)
            last = Parameter("quiet", Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
            run.__signature__ = own.replace(parameters=[*own.parameters.values(), last])  # type: ignore[attr-defined]
            run.__annotations__ = {**function.__annotations__, "quiet": Quiet}
            super(App, self).command(*names, **options)(run)
            return function

        return decorate


def _tell_compilation(kept: bool) -> None:
    if not running.quiet and sys.stderr.isatty():
        print(
            "compiling, once" if kept else "compiling: no folder can keep the result",
            file=sys.stderr,
        )


def cpu_seconds() -> float:
    """Return the CPU seconds of this process, all its threads, and its ended child processes."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def say_done(text: str) -> None:
    """Print the closing line of a command with its wall and CPU time, unless ``--quiet`` is given."""
    if not running.quiet:
        wall, cpu = time.perf_counter() - running.started, cpu_seconds() - running.cpu
        say(f"{text}; {wall:.1f} s, {cpu:.1f} s of CPU time")


def console(**options: Any) -> Console:
    """Return a console without markup: brackets and colons are printed unchanged."""
    from rich.console import Console

    return Console(markup=False, emoji=False, highlight=False, **options)


@contextmanager
def progress_bar(title: str, *, at_once: bool = False) -> Iterator[Report]:
    """Show progress on the error stream; yield a function of done, total and a text on the last step.

    A terminal gets a bar with the time so far and the time left; a log gets one line every `EVERY_SECONDS`.

    Parameters
    ----------
    title : str
    at_once : bool
        Show a bar before the first report, for work that may have no countable steps.
    """
    out = console(stderr=True)
    if running.quiet:
        yield lambda done, total, step: None
    elif out.is_terminal:
        with _bar(title, at_once, out) as report:
            yield report
    else:
        yield _lines(title, out)


@contextmanager
def _bar(title: str, at_once: bool, out: Console) -> Iterator[Report]:
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
    from rich.text import Text

    state = State()

    class Told(ProgressColumn):
        """Column of the state, whose times are updated between reports."""

        def render(self, task: Any) -> Text:
            return Text(str(state))

    bar = Progress(TextColumn("{task.description}", markup=False), BarColumn(BAR), Told(), console=out)
    task = bar.add_task(one_line(title), total=None)

    def report(done: int, total: int, step: str) -> None:
        bar.start()  # started late, so that a failure before the first step leaves no empty bar
        state.update(done, total, step)
        bar.update(task, completed=done, total=total)

    if at_once:
        bar.start()
    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()


class State:
    """Steps done, the time so far, and the time left."""

    def __init__(self) -> None:
        self.done, self.total, self.step = 0, 0, ""
        self.began = self.updated = time.monotonic()
        self._since: tuple[int, float] | None = None  # steps and time from which on they tell the rate

    def update(self, done: int, total: int, step: str) -> None:
        """Set the number of steps done."""
        self.updated = time.monotonic()
        # the next run starts from 0; the very first step may have compiled
        if done < self.done or (self._since is None and done):
            self._since = done, self.updated
        self.done, self.total, self.step = done, total, one_line(step)

    def __str__(self) -> str:
        now = time.monotonic()
        parts = [f"{self.done}/{self.total} {self.step}".rstrip()] if self.total else []
        parts.append(_minutes(now - self.began))
        if self._since is not None and self._since[0] < self.done < self.total:
            done, since = self._since
            rest = (self.updated - since) * (self.total - self.done) / (self.done - done)
            parts.append(f"{_minutes(max(0.0, self.updated + rest - now))} left")
        return ", ".join(parts)


def _minutes(seconds: float) -> str:
    return f"{seconds // 60:.0f}:{seconds % 60:02.0f}" if seconds % 60 < 59.5 else f"{seconds // 60 + 1:.0f}:00"


def _lines(title: str, out: Console) -> Report:
    """Return a function that prints a line of progress every `EVERY_SECONDS`."""
    printed, state = time.monotonic(), State()

    def report(done: int, total: int, step: str) -> None:
        nonlocal printed
        state.update(done, total, step)
        if state.updated - printed >= EVERY_SECONDS:
            printed = state.updated
            out.print(f"{one_line(title)}: {state}", soft_wrap=True)

    return report


@contextmanager
def spinner(title: str) -> Iterator[None]:
    """Show a spinner on the error stream, for work without countable steps."""
    from rich.text import Text

    out = console(stderr=True)
    if running.quiet:
        yield
        return
    with out.status(Text(one_line(title)), spinner="dots" if out.encoding.startswith("utf") else "line"):
        yield
