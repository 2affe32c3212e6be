"""Every fault has exactly one place in the tree, and anchors do not depend on layout and file."""

import ast
import re

import pytest

from tests.planted.anchors import AnchorError, Package
from tests.planted.plant import FAULTS, ROOT, find_invalid_faults

SOURCE = '''
import math
from os import path as place

LIMIT, SHARE = (
    2.0,  # at most
    0.5,
)


class Law:
    scale: float = 3.0

    @property
    def size(self): return self.scale  # the same line

    def at(self, x):
        """Return the value at ä."""
        for one in (
            1,
            2,
        ):  # all

            x += one
            print(x)
            print("ä", x * (x + 1))
        return math.sin(x)


def outer(x):
    if x:
        def inner(y):
            return [y
                    + 1, f"{y + 2}"]
    else:
        def inner(y):
            return y - 1
    return inner(x)
'''


@pytest.fixture
def plant_fault(tmp_path):
    """Return a function that plants a fault into the source and returns it with normalized layout."""
    (tmp_path / "flexcam" / "part").mkdir(parents=True)
    (tmp_path / "flexcam" / "part" / "law.py").write_text(SOURCE, encoding="utf-8")
    (tmp_path / "flexcam" / "other.py").write_text("LIMIT = 2.0\n\n\ndef outer(z):\n    return z\n", encoding="utf-8")

    def plant(symbol, old, new, **more):
        place = {"symbol": symbol} if symbol else {}
        edit = Package(tmp_path).edit({"name": "the fault", "old": old, "new": new, **place, **more})
        edit.apply(tmp_path)
        return ast.unparse(ast.parse((tmp_path / edit.path).read_text(encoding="utf-8")))

    return plant


def test_every_fault_has_one_place_and_existing_tests():
    assert not find_invalid_faults(FAULTS, ROOT)


def test_names_of_faults_are_unique():
    names = [fault["name"] for fault in FAULTS]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("symbol", "old", "new", "line"),
    [
        ("Law.at", "x * (x+1)", "x + 1", "print('ä', x + 1)"),
        ("Law.at", "math.sin", "lambda z: z", "return (lambda z: z)(x)"),
        ("outer.inner", "y + 1", "y", "return [y, f'{y + 2}']"),
        ("LIMIT", "LIMIT, SHARE = 2.0, 0.5", "LIMIT, SHARE = 1.0, 0.5", "LIMIT, SHARE = (1.0, 0.5)"),
        ("Law.scale", "3.0", "4.0", "scale: float = 4.0"),
        ("place", "from os import path as place", "from os import sep as place", "from os import sep as place"),
        ("Law.size", "return self.scale", "return 0.0", "return 0.0"),
        ("Law.size", "def size(self): ...", "def size(self, **more): ...", "def size(self, **more):"),
        ("Law.at", "def at(self, x): ...", "def at(self, x=0): ...", "def at(self, x=0):"),
        ("Law.at", "for one in (1, 2): ...", "while True: ...", "while True:"),
    ],
)
def test_code_is_replaced_within_its_symbol(plant_fault, symbol, old, new, line):
    before = ast.unparse(ast.parse(SOURCE)).splitlines()
    after = plant_fault(symbol, old, new).splitlines()
    assert len(after) == len(before)
    assert [one.strip() for one, other in zip(after, before, strict=True) if one != other] == [line]


def test_consecutive_statements_are_replaced(plant_fault):
    expected = plant_fault("Law.at", "x += one\nprint(x)", "if one:\n    x = one")
    assert "            if one:\n                x = one\n            print('ä'" in expected


def test_module_selects_among_equal_symbols(plant_fault):
    assert "LIMIT, SHARE = (1.0, 0.5)" in plant_fault("LIMIT", "2.0", "1.0", module="part.law")


@pytest.mark.parametrize(
    ("symbol", "old", "new", "expected"),
    [
        ("LIMIT", "2.0", "1.0", "2 times in LIMIT: LIMIT (flexcam/other.py:1), LIMIT (flexcam/part/law.py:5)"),
        ("Law.gone", "math.sin(x)", "x", "0 times in Law.gone, which is not defined; it occurs in Law (flexcam/"),
        ("Law.size", "math.sin(x)", "x", "0 times in Law.size (defined as Law.size (flexcam/part/law.py:"),
        ("Law.at", "math.cos(x)", "x", "it occurs in no other definition"),
        ("Law.at", "math.sin(x)", "x +", "not both expressions, headers or statements"),
        ("Law.at", "math.sin(x)", "math.sin( x )", "`new` says the same as `old`"),
        ("Law.at", "return math.sin(x)", "break", "is not Python"),
    ],
)
def test_invalid_anchor_raises_error(plant_fault, symbol, old, new, expected):
    with pytest.raises(AnchorError, match=f"the fault: .*{re.escape(expected)}"):
        plant_fault(symbol, old, new)


def test_text_of_named_file_must_occur_once(plant_fault):
    assert "return y" in plant_fault("", "return z", "return y", file="flexcam/other.py")
    with pytest.raises(AnchorError, match=r"'inner' occurs 0 times in flexcam/other\.py"):
        plant_fault("", "inner", "y", file="flexcam/other.py")
