"""Results of observers: files of JSON lines that the page writes, and checks of their integrity."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ii_core.base import checks
from ii_core.base.files import check_file, one_line, parse_json

from . import plan as plans

FORMAT, VERSION = "ii-observer", 1
MOST_BYTES = 16 << 20  # largest file: a hundred times a long test
SEAL = re.compile(r',"check":"([0-9a-f]{64})"}$')
CHOICES = {"dsis": (1, 2, 3, 4, 5), "pairs": ("left", "same", "right")}


class Observer(NamedTuple):
    """Answers of one observer.

    Attributes
    ----------
    number : int
    answers : list of ((int, int), answer)
        The pair of stimuli shown and the grade, 1 to 5, or "left", "same" or "right"; answers of the training are not
        included.
    complete : bool
        Whether the observer finished the test.
    colours : bool
        Whether the observer read the plates of colours.
    simulated : bool
        Whether the answers are simulated: no person took part.
    """

    number: int
    answers: list[tuple[tuple[int, int], Any]]
    complete: bool
    colours: bool
    simulated: bool


class Results(NamedTuple):
    """Results of a test.

    Attributes
    ----------
    plan : dict
        Plan of the test, with its ``method`` and ``stimuli``.
    observers : list of Observer
        Observers whose files are whole, by number.
    notes : list of str
        A line for every file that is left out and every observer who did not finish.
    """

    plan: dict[str, Any]
    observers: list[Observer]
    notes: list[str]


@checks.checked(paths=checks.sequence)
def read_results(paths: Sequence[str | os.PathLike[str]]) -> Results:
    """Read the files of observers, with one clear line for each that cannot be used.

    Empty files, files of another test than the first, a second file of one observer, and files with a line that was
    changed, removed or added by hand are left out. The check finds accidents and careless changes; it is no
    signature. The answers of observers who did not finish count.

    Parameters
    ----------
    paths : list of path

    Raises
    ------
    ValueError
        If no file can be used; the message is the note on the first file.
    OSError
        If a file cannot be read.
    """
    for one in paths:
        checks.path("paths", one)
    notes: list[str] = []
    found: dict[int, tuple[str, Observer]] = {}
    text = ""
    for path in map(Path, paths):
        check_file(path)
        try:
            made, observer = read_observer(path)
            text = text or made
            if made != text:
                raise ValueError(f"{path} is of another test than the files before it")
            if observer.number in found:
                raise ValueError(f"{path} is of observer {observer.number}, as {found[observer.number][0]} is")
        except ValueError as error:
            notes.append(f"{error}: left out")
            continue
        found[observer.number] = (str(path), observer)
        if not observer.complete:
            order = json.loads(text)["orders"][0]
            notes.append(f"{path}: stopped after {len(observer.answers)} of {len(order)} answers, which count")
    if not found:
        raise ValueError(notes[0] if notes else "paths: there are no files of observers: at least one is needed")
    return Results(json.loads(text), [observer for _, (_, observer) in sorted(found.items())], notes)


def read_observer(path: Path) -> tuple[str, Observer]:
    """Return the text of the plan and the answers of one file.

    Raises
    ------
    ValueError
        If the file is empty, or a line is not as the page wrote it; an incomplete last line is ignored.
    """
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(f"{path} has more than {MOST_BYTES >> 20} MB, no result of an observer")
    records = checked_lines(path.read_bytes(), str(path))
    if not records:
        raise ValueError(f"{path} is empty: nobody answered")
    first = records[0]
    if (first.get("format"), first.get("version"), first.get("kind")) != (FORMAT, VERSION, "begin"):
        raise ValueError(f'{path} is no result of an observer: its first line needs "format": "{FORMAT}"')
    text, number = first.get("plan"), first.get("observer")
    if not (isinstance(text, str) and isinstance(number, int) and number > 0):
        raise ValueError(f"{path} has no plan or number in its first line")
    plan = _plan(text, path)
    order = [*plan["training"], *plan["orders"][(number - 1) % len(plan["orders"])]]
    answers = [record for record in records if record.get("kind") == "answer"]
    if len(answers) > len(order):
        raise ValueError(f"{path} has {len(answers)} answers, its test {len(order)}")
    counted = []
    for place, (record, pair) in enumerate(zip(answers, order, strict=False)):
        if record.get("place") != place or record.get("pair") != pair:
            raise ValueError(f"{path}, answer {place + 1}: not what observer {number} was shown there")
        answer = record.get("answer")
        if isinstance(answer, bool) or answer not in CHOICES[plan["method"]]:
            raise ValueError(f"{path}, answer {place + 1}: {answer!r} is no answer of this test")
        if place >= len(plan["training"]):
            counted.append(((pair[0], pair[1]), answer))
    complete, colours = len(answers) == len(order), first.get("colour_vision") == "passed"
    return text, Observer(number, counted, complete, colours, first.get("simulated") is True)


def sealed(record: dict[str, Any], before: str = "") -> str:
    """Return a record as a line, sealed after the line before it."""
    text = json.dumps(record, ensure_ascii=False)
    seal = SEAL.search(before.rstrip("\n"))
    digest = hashlib.sha256(((seal[1] if seal else "") + text).encode()).hexdigest()
    return f'{text[:-1]},"check":"{digest}"}}\n'


def checked_lines(data: bytes, name: str) -> list[dict[str, Any]]:
    """Return the records of whole lines whose seals continue one another.

    Raises
    ------
    ValueError
        If a line is no JSON object or its seal is wrong.
    """
    records, before, when = [], "", ""
    for number, raw in enumerate(data.splitlines(keepends=True), 1):
        if not raw.endswith(b"\n"):
            break
        line = raw.decode("utf-8", errors="replace").rstrip("\r\n")
        found = SEAL.search(line)
        if found is None:
            raise ValueError(f"{name}, line {number} has no seal: not what the page wrote")
        text = line[: found.start()] + "}"
        if hashlib.sha256((before + text).encode()).hexdigest() != found[1]:
            raise ValueError(f"{name}, line {number} was changed, or a line before it removed or added")
        try:
            record = parse_json(text)
        except ValueError as error:
            raise ValueError(f"{name}, line {number}: {error}") from None
        at = record.get("at") if isinstance(record, dict) else None
        if not isinstance(at, str):
            raise ValueError(f"{name}, line {number} is no record with its time")
        if record.get("kind") != "resume" and at < when:
            raise ValueError(f"{name}, line {number} is of {at}, before the line above it, {when}")
        before, when = found[1], at
        records.append(record)
    return records


def _plan(text: str, path: Path) -> dict[str, Any]:
    try:
        plan = parse_json(text)
        _check_plan(plan)
    except ValueError as error:
        raise ValueError(f"{path} has no plan of a test that this version reads: {one_line(error)}") from None
    return dict(plan)


def _check_plan(plan: Any) -> None:
    """Raise ValueError unless every part of a plan that the analysis reads has its kind."""
    if not isinstance(plan, dict) or (plan.get("format"), plan.get("version")) != (plans.FORMAT, plans.VERSION):
        raise ValueError(f'"format": "{plans.FORMAT}", "version": {plans.VERSION} is needed')
    if plan.get("method") not in plans.METHODS:
        raise ValueError(f"method is {checks.shown(plan.get('method'))}: {' or '.join(plans.METHODS)} is needed")
    for number, one in enumerate(_list(plan, "stimuli")):
        _check_stimulus(one, f"stimuli.{number}")
    count = len(plan["stimuli"])
    orders = {"training": _list(plan, "training", least=0)}
    orders |= {f"orders.{number}": order for number, order in enumerate(_list(plan, "orders"))}
    for name, order in orders.items():
        for pair in order if isinstance(order, list) else [order]:
            right = isinstance(pair, list) and len(pair) == 2
            if not (right and all(type(n) is int and 0 <= n < count for n in pair)):
                raise ValueError(f"{name} holds {checks.shown(pair)}: a list of pairs of stimuli is needed")


def _check_stimulus(one: Any, where: str) -> None:
    if not isinstance(one, dict):
        raise ValueError(f"{where} is {checks.shown(one)}: an object is needed")
    kinds = {"scene": str, "name": str, "scheme": str, "reference": bool, "measures": dict}
    for key, kind in kinds.items():
        if not isinstance(one.get(key), kind):
            wanted = {str: "text", bool: "true or false", dict: "an object"}[kind]
            raise ValueError(f"{where}.{key} is {checks.shown(one.get(key))}: {wanted} is needed")
    for name, value in one["measures"].items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(_float(value)):
            raise ValueError(f"{where}.measures.{name} is {checks.shown(value)}: a finite number is needed")


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _list(plan: dict[str, Any], key: str, least: int = 1) -> list[Any]:
    value = plan.get(key)
    if not isinstance(value, list) or len(value) < least:
        raise ValueError(f"{key} is {checks.shown(value)}: a list{' that is not empty' if least else ''} is needed")
    return value
