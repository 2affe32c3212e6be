"""Parts of reports of faults: those at a key, and words that no report may have."""

from __future__ import annotations

import re

LIBRARY_WORDS = (
    "Value error", "float()", "numpy", "dictionary", "Tuple should", "NoneType", "Traceback", "discriminator",
    "instance of",
)  # fmt: skip
"""Words of Python and its libraries, which mean nothing to the user of a case file."""


def is_at(where, key):
    """Tell whether a place is a key or inside it; ``a.b (line 3): c`` is a place in ``a.b`` as well."""
    return re.sub(r" \(line \d+\)", "", where).replace(": ", ".").startswith(key)
