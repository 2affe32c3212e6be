"""Helpers for fault reports: location of a fault and words of libraries that no message contains."""

import re

LIBRARY_WORDS = (
    "Value error", "float()", "numpy", "dictionary", "Tuple should", "NoneType", "Traceback", "discriminator",
    "instance of",
)  # fmt: skip
"""Words of Python and its libraries that a user of case files does not know."""


def is_at(where, key):
    """Return whether a fault is at a key or inside it; ``a.b (line 3): c`` is inside ``a.b`` as well."""
    return re.sub(r" \(line [^)]*\)", "", where).replace(": ", ".").startswith(key)
