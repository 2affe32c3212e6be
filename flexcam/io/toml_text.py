"""Tables as TOML text in which a short array stands in one line."""

from __future__ import annotations

import re
from collections.abc import Mapping

_ARRAY = re.compile(r"^(?P<head>.*)\[\n(?P<body>(?: +[^ \[\]{}].*,\n)+) *\](?P<tail>,?)$", re.MULTILINE)
"""An array as tomli_w writes it, an element to a line; one of arrays or tables stays as it is."""

_WIDE = 100
"""Letters of a line."""


def toml_text(content: Mapping[str, object]) -> str:
    """Return tables as TOML text."""
    import tomli_w

    return _ARRAY.sub(_joined, tomli_w.dumps(content))


def _joined(found: re.Match[str]) -> str:
    lines = found["body"].removesuffix("\n").split("\n")  # a text may hold what Python too takes for the end of a line
    elements = [line.strip(" ").removesuffix(",") for line in lines]
    line = f"{found['head']}[{', '.join(elements)}]{found['tail']}"
    return line if len(line) <= _WIDE else found[0]
