"""Validation errors of pydantic, reworded for users."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

_WORDS = {
    "missing": "is missing",
    "greater_than": "{input!r}: a number greater than {gt:g} is needed",
    "greater_than_equal": "{input!r}: a number of at least {ge:g} is needed",
    "less_than": "{input!r}: a number less than {lt:g} is needed",
    "less_than_equal": "{input!r}: a number of at most {le:g} is needed",
    "finite_number": "{input!r}: a finite number is needed",
    "float_type": "{input!r}: a number is needed",
    "float_parsing": "{input!r}: a number is needed",
    "int_type": "{input!r}: a whole number is needed",
    "int_parsing": "{input!r}: a whole number is needed",
    "int_from_float": "{input!r}: a whole number is needed",
    "string_type": "{input!r}: a text is needed",
    "bool_type": "{input!r}: true or false is needed",
    "bool_parsing": "{input!r}: true or false is needed",
    "tuple_type": "{input!r}: a list of numbers is needed",
    "list_type": "{input!r}: a list is needed",
    "dict_type": "{input!r}: a table of keys is needed",
    "model_type": "{input!r}: a table of keys is needed",
    "model_attributes_type": "{input!r}: a table of keys is needed",
    "literal_error": "unknown {input!r}: known are {expected}",
    "union_tag_invalid": "unknown {discriminator} {tag!r}: known are {expected_tags}",
    "union_tag_not_found": "{discriminator} is missing",
}


def words(complaint: Any) -> str:
    """Return the message of one entry of ``ValidationError.errors()``."""
    if complaint["type"] not in _WORDS:
        return str(complaint["msg"]).removeprefix("Value error, ")
    context = {k: v.replace("'", "") if isinstance(v, str) else v for k, v in complaint.get("ctx", {}).items()}
    return _WORDS[complaint["type"]].format(input=complaint["input"], **context)


def line(error: ValidationError, place: Sequence[Any], text: str) -> str:
    """Return place and message of the first error, and the number of others."""
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"{'.'.join(map(str, place))}{': ' if place else ''}{text}{more}"
