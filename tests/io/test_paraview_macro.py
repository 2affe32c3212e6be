"""The macro of an exported collection; `test_paraview` runs it in ParaView."""

import ast

import numpy as np
import pytest

from flexcam import InputError
from flexcam.io import write_macro, write_pvd

QUOTED_NAME = 'a"""\nraise SystemExit("run")  # \\'
"""Name of a collection that would end a docstring and add a statement; its last character escapes a quote."""


@pytest.fixture
def macro_and_degrees(stored, tmp_path):
    """Export every sixth step with its macro, under a name with special characters."""
    files = write_pvd(stored.result, tmp_path / "Größe & Maß.pvd", every=6)
    degrees = np.degrees(stored.response.field_angle[::6])
    return write_macro(files[0], ["displacement", "stress_von_mises"], degrees.tolist()), degrees


def test_macro_is_python_with_collection_name(macro_and_degrees):
    macro, degrees = macro_and_degrees
    tree = ast.parse(macro.read_text(encoding="utf-8"))
    values = {node.targets[0].id: ast.literal_eval(node.value) for node in tree.body
              if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "").isupper()}  # fmt: skip
    assert values["COLLECTION"] == "Größe & Maß.pvd"
    assert values["COLOUR"] == "stress_von_mises"
    assert values["DEGREES"] == pytest.approx(degrees.tolist(), abs=1e-6)
    assert values["WRITTEN_IN"] == str(macro.parent)


def test_existing_macro_is_overwritten_only_on_request(macro_and_degrees):
    macro, _ = macro_and_degrees
    with pytest.raises(InputError, match="overwrite"):
        write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0])
    write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0], overwrite=True)
    assert "COLOUR = 'displacement'" in macro.read_text(encoding="utf-8")


def test_name_with_quotes_and_backslash_is_escaped(tmp_path):
    macro = ast.parse(write_macro(tmp_path / f"{QUOTED_NAME}.pvd", ["displacement"], [0.0]).read_text(encoding="utf-8"))
    assert ast.get_docstring(macro)
    assert not [one for one in macro.body if isinstance(one, ast.Raise)]
    given = {one.value for one in ast.walk(macro) if isinstance(one, ast.Constant)}
    assert {QUOTED_NAME, f"{QUOTED_NAME}.pvd"} <= given
