"""Laws by name, kinds by id, and laws of other packages."""

from __future__ import annotations

import importlib.metadata
import inspect
from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import TypeAdapter

from flexcam import cams
from flexcam.cams import KINDS, LAWS, kind_names, law_kind, law_registry
from flexcam.case.curves import LawValue, parse_law
from flexcam.cli.law import find_law
from flexcam.core.errors import InputError

Z = np.linspace(0.0, 1.0, 11)


@dataclass(frozen=True)
class Skewed:
    """Law of another package: s = z^power."""

    power: float = 2.0
    breaks = ()

    def __call__(self, z, order=0):
        return z**self.power if order == 0 else np.zeros_like(z)


@pytest.fixture
def install_plugins(monkeypatch):
    """Return a function that installs packages with the given entry points, as importlib.metadata reports them."""

    def install(points):
        made = importlib.metadata.EntryPoints(
            importlib.metadata.EntryPoint(name, target, law_registry.GROUP) for name, target in points.items()
        )

        def entry_points(**selection):
            return made.select(**selection)

        monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
        monkeypatch.setattr(law_registry, "entry_points", entry_points, raising=False)

    return install


def test_entry_point_adds_law_kind(install_plugins):
    install_plugins({"line": "flexcam.cams.standard_laws:Harmonic", "stdlib": "fractions:Fraction"})
    assert law_kind("line") is cams.Harmonic
    assert kind_names() == (*KINDS, "line", "stdlib")
    assert law_kind("lines") is None


@pytest.mark.parametrize("target", ["no_such_package:Law", "fractions:Law", "this_breaks:Law"])
def test_broken_entry_point_is_named_in_error(install_plugins, target, tmp_path, monkeypatch):
    (tmp_path / "this_breaks.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    install_plugins({"broken": target, "line": "flexcam.cams.standard_laws:Harmonic"})
    assert law_kind("line") is cams.Harmonic
    assert parse_law({"id": "fb2", "split": 0.3}).law == KINDS["fb2"](0.3)
    with pytest.raises(InputError, match=f"'broken'.*The package {target}, which defines it, failed"):
        parse_law("broken")


def test_entry_point_is_loaded_from_its_module(install_plugins, monkeypatch):
    """The module is imported only when the law is requested."""
    import sys
    import types

    module = types.ModuleType("another_package")
    module.Skewed = Skewed
    monkeypatch.setitem(sys.modules, "another_package", module)
    install_plugins({"skewed": "another_package:Skewed"})
    np.testing.assert_allclose(law_kind("skewed")(power=3.0)(Z), Z**3)
    np.testing.assert_allclose(find_law("skewed")(Z), Z**2)
    np.testing.assert_allclose(find_law("skewed", ["power=3"])(Z), Z**3)
    assert "skewed" in TypeAdapter(LawValue).json_schema()["anyOf"][1]["properties"]["id"]["enum"]


def test_builtin_kinds_take_precedence(install_plugins):
    install_plugins({"fb2": "flexcam.cams.standard_laws:Harmonic"})
    assert law_kind("fb2") is KINDS["fb2"]
    assert kind_names() == tuple(KINDS)


def test_kind_names_without_plugins(install_plugins):
    install_plugins({})
    assert kind_names() == tuple(KINDS)


def test_only_laws_group_is_queried(monkeypatch):
    asked = []
    monkeypatch.setattr(law_registry, "entry_points", lambda **selection: asked.append(selection) or [])
    kind_names()
    assert asked == [{"group": "flexcam.laws"}]


def test_law_tables_are_read_only():
    with pytest.raises(TypeError):
        LAWS["new"] = LAWS["shm"]
    with pytest.raises(TypeError):
        KINDS["new"] = KINDS["fb2"]


@pytest.mark.parametrize("name", sorted(KINDS))
def test_every_parameter_is_annotated(name):
    """The keys of a case are made from the annotations."""
    parameters = inspect.signature(KINDS[name]).parameters
    assert parameters
    assert all(p.annotation is not inspect.Parameter.empty for p in parameters.values())


def test_petrescu_name_cos_is_simple_harmonic_motion():
    np.testing.assert_array_equal(LAWS["cos"](Z, 2), LAWS["shm"](Z, 2))


@pytest.mark.parametrize("row", [1, 2, 3, 4])
def test_quinquinomial_rows_by_name(row):
    name = "quinquinomial" if row == 1 else f"quinquinomial-{row}"
    assert LAWS[name].exponents[1] == 2 + 3 * row
