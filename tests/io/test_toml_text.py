"""Readable TOML text: short arrays on one line, and unchanged content."""

import tomllib

from hypothesis import example, given, settings
from hypothesis import strategies as st

from flexcam.io import format_toml

LEAVES = st.one_of(st.booleans(), st.integers(-9, 9), st.floats(allow_nan=False), st.text(max_size=4),
                   st.sampled_from(["[\n", "],\n", " = [\n    1,\n]", "#", "}"]))  # fmt: skip
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
)


@given(st.dictionaries(st.text(max_size=3), VALUES, max_size=3))
@example({"": ["\x85", "\u2028", "\x0c"]})
@settings(max_examples=15)
def test_toml_round_trip(content):
    assert tomllib.loads(format_toml(content)) == content


def test_short_arrays_are_on_one_line():
    text = format_toml({"held": ["ux", "uy"], "rows": [[1, 2], [3, 4]], "long": list(range(60))})
    assert 'held = ["ux", "uy"]\n' in text
    assert "rows = [\n    [1, 2],\n    [3, 4],\n]\n" in text
    assert "long = [\n    0,\n" in text
