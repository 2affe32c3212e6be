"""What pydantic expects, in the words of a case file."""

from __future__ import annotations

from pydantic_core import ErrorDetails

_KINDS = {
    "string_type": "a text", "bool_type": "true or false", "bool_parsing": "true or false", "list_type": "a list",
    "tuple_type": "a list", "dict_type": "a table", "float_type": "a number", "float_parsing": "a number",
    "int_type": "a whole number", "int_parsing": "a whole number", "int_from_float": "a whole number",
}  # fmt: skip
"""What it calls a valid string, boolean, list, tuple, dictionary or number."""


def expected(error: ErrorDetails) -> str:
    """Return what may stand in the place of a value."""
    return _KINDS.get(error["type"]) or error["msg"].replace("Input should be ", "")
