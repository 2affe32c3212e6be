"""The macro beside an exported collection; `test_paraview` runs it in ParaView."""

from __future__ import annotations

import ast

import numpy as np
import pytest

from flexcam import InputError
from flexcam.io import write_macro, write_pvd

NAMED = 'a"""\nraise SystemExit("run")  # \\'
"""Name of a collection that ends a docstring and goes on as a statement; its last character escapes a quote."""


@pytest.fixture
def exported(done, tmp_path):
    """Export every sixth instant with its macro, under a name that needs care."""
    files = write_pvd(done.result, tmp_path / "Größe & Maß.pvd", every=6)
    degrees = np.degrees(done.response.field_angle[::6])
    return write_macro(files[0], ["displacement", "stress_von_mises"], degrees.tolist()), degrees


def test_it_is_python_that_names_its_collection(exported):
    macro, degrees = exported
    tree = ast.parse(macro.read_text(encoding="utf-8"))
    values = {node.targets[0].id: ast.literal_eval(node.value) for node in tree.body
              if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "").isupper()}  # fmt: skip
    assert values["COLLECTION"] == "Größe & Maß.pvd"
    assert values["COLOUR"] == "stress_von_mises"
    assert values["DEGREES"] == pytest.approx(degrees.tolist(), abs=1e-6)
    assert values["WRITTEN_IN"] == str(macro.parent)


def test_it_writes_over_nothing_unasked(exported):
    macro, _ = exported
    with pytest.raises(InputError, match="overwrite"):
        write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0])
    write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0], overwrite=True)
    assert "COLOUR = 'displacement'" in macro.read_text(encoding="utf-8")


def test_a_name_with_quotes_and_a_backslash_stays_a_name(tmp_path):
    macro = ast.parse(write_macro(tmp_path / f"{NAMED}.pvd", ["displacement"], [0.0]).read_text(encoding="utf-8"))
    assert ast.get_docstring(macro)
    assert not [one for one in macro.body if isinstance(one, ast.Raise)]
    given = {one.value for one in ast.walk(macro) if isinstance(one, ast.Constant)}
    assert {NAMED, f"{NAMED}.pvd"} <= given
