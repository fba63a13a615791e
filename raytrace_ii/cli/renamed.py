"""Former names of options, which commands take for one more version."""

from __future__ import annotations

import sys
from collections.abc import Sequence

RENAMED = {
    "display": {"--depth": "--plane"},
    "video": {"--depth": "--plane"},
    "measure": {"--focus": "--depth-from-focus"},
    "opinions": {"--plot": "--chart"},
    "encode": {"--rate": "--rate-over"},
    "eye": {"--gap": "--gap-mm", "--lens-pitch": "--lens-pitch-mm"},
}


def present(words: Sequence[str]) -> list[str]:
    """Return the words of a command line with today's names of options; a note tells each that was replaced."""
    command = next((word for word in words if not word.startswith("-")), "")
    names, made = RENAMED.get(command, {}), list(words)
    for i, word in enumerate(words):
        if word == "--":
            break
        old, equals, value = word.partition("=")
        if old in names:
            made[i] = names[old] + equals + value
            print(f"note: {old} of {command} is called {names[old]} now", file=sys.stderr)
    return made
