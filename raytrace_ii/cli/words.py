"""Text for a terminal, without control characters."""

from __future__ import annotations

import codecs

# Replacements for the characters of our messages on ASCII terminals.
ASCII = {
    "×": "x", "–": "-", "−": "-", "…": "...", "·": "*", "°": " deg", "±": "+-", "≥": ">=", "≤": "<=", "∞": "inf",
    "σ": "sigma", "δ": "d", "Λ": "Lambda", "Γ": "Gamma", "φ": "phi", "θ": "theta", "λ": "lambda", "µ": "u", "μ": "u",
    "²": "^2", "³": "^3", "é": "e", "ø": "o", "→": "->", "‖": "||", "⅓": "1/3", "½": "1/2",
    "─": "-", "━": "-", "╺": "-", "╸": "-", "│": "|", "┃": "|",
}  # fmt: skip
SPELT = "raytrace-ii-spelt"  # name of our error handler in `codecs`


def plain(text: str) -> str:
    """Return the text with control characters and invalid UTF-8 as escapes: \\\\x1b instead of a colour."""
    return "".join(c if c.isprintable() or c == "\n" else _escaped(c) for c in text)


def one_line(text: str) -> str:
    """Return `plain` text on one line."""
    return plain(" ".join(text.split()))


def say(text: object = "") -> None:
    """Print a result to the output stream."""
    print(plain(str(text)))


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def _spelt(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    part = error.object[error.start : error.end]
    return "".join(ASCII.get(c, _escaped(c)) for c in part), error.end


codecs.register_error(SPELT, _spelt)
