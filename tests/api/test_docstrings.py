"""Every public function and class: annotated, no **kwargs, and a docstring whose parameters are the signature's."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re

import pytest

import flexcam
from flexcam.dynamics import force_laws
from flexcam.dynamics.force_laws import LAWS

MODULES = [
    importlib.import_module(m.name)
    for m in pkgutil.walk_packages(flexcam.__path__, "flexcam.")
    if not m.name.endswith("__main__")
]


def own(module, kind):
    """Return the public functions or classes that a module defines, by their full names."""
    return {
        f"{module.__name__}.{name}": item
        for name, item in vars(module).items()
        if not name.startswith("_") and kind(item) and getattr(item, "__module__", None) == module.__name__
    }


FUNCTIONS = {name: item for module in MODULES for name, item in own(module, inspect.isfunction).items()}
CLASSES = {name: item for module in MODULES for name, item in own(module, inspect.isclass).items()}
METHODS = {
    f"{owner}.{name}": item
    for owner, kind in CLASSES.items()
    for name, raw in vars(kind).items()
    if not name.startswith("_")
    and inspect.isfunction(item := inspect.unwrap(getattr(raw, "__func__", getattr(raw, "fget", raw))))
}


def section(doc, title):
    """Return the body of a numpydoc section, or None."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", doc, re.S | re.M)
    return found[1] if found else None


def documented(item):
    """Return the names of the section Parameters, in order."""
    body = section(inspect.getdoc(item) or "", "Parameters")
    if body is None:
        return []
    heads = [line.partition(" :")[0] for line in body.splitlines() if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def parameters(item):
    return [p for p in inspect.signature(item).parameters.values() if p.name not in ("self", "cls")]


def gaps(function):
    """Return what is not annotated, and whether unknown keywords are swallowed."""
    lacking = [p.name for p in parameters(function) if p.annotation is p.empty]
    lacking += ["return"] if inspect.signature(function).return_annotation is inspect.Signature.empty else []
    return lacking + [f"**{p.name}" for p in parameters(function) if p.kind is p.VAR_KEYWORD]


def test_something_is_looked_at():
    assert len(FUNCTIONS) > 80
    assert len(CLASSES) > 40
    assert len(METHODS) > 40


def test_annotated_and_no_unknown_keywords():
    faults = {name: gaps(item) for name, item in (FUNCTIONS | METHODS).items() if gaps(item)}
    assert not faults


def test_every_public_function_has_a_docstring():
    assert not [name for name, item in (FUNCTIONS | METHODS).items() if not (inspect.getdoc(item) or "").strip()]


def fields(kind):
    if dataclasses.is_dataclass(kind):
        return [f.name for f in dataclasses.fields(kind) if f.init]
    return [p.name for p in parameters(kind.__init__)] if "__init__" in vars(kind) else []


SHARED = {
    "x", "v", "stiffness", "damping", "x_begin", "state", "step", "constants", "b", "i", "local", "tangent",
}  # fmt: skip
"""Parameters of force laws that the docstring of `flexcam.dynamics.force_laws` describes."""
OF_LAWS = {"force_laws", "oil_laws", "law_data"}


def undocumented(items):
    """Return the functions whose section Parameters is not that of the signature, with both."""
    shared = {name: SHARED if OF_LAWS.intersection(name.split(".")) else set() for name, _ in items}
    both = {n: (documented(item), [p.name for p in parameters(item) if p.name not in shared[n]]) for n, item in items}
    return {name: pair for name, pair in both.items() if pair[0] != pair[1]}


def test_documented_parameters_are_the_signatures():
    """A docstring need not list the parameters; one that does lists all of them."""
    items = [(name, item) for name, item in (FUNCTIONS | METHODS).items() if documented(item) and ".cli." not in name]
    assert len(items) > 50
    assert not undocumented(items)


def test_documented_fields_are_the_constructors():
    """A base class documents its own fields, hence a class may list those that it declares itself."""
    kinds = {name: kind for name, kind in CLASSES.items() if documented(kind)}
    declared = {
        name: [f for f in fields(kind) if f in vars(kind).get("__annotations__", {})] for name, kind in kinds.items()
    }
    assert kinds
    assert not [name for name, kind in kinds.items() if documented(kind) not in (fields(kind), declared[name])]


def test_elements_are_documented_in_full():
    items = {name: item for name, item in FUNCTIONS.items() if name.startswith("flexcam.fem.elements.")}
    assert items
    assert not undocumented(items.items())
    returning = {n: f for n, f in items.items() if inspect.signature(f).return_annotation not in ("None", None)}
    assert not [name for name, item in returning.items() if not section(inspect.getdoc(item) or "", "Returns")]


def test_integrators_and_laws_document_every_parameter():
    made = ("Scheme", "Bathe", "CentralDifference", "Collocation", "ScipyIntegrator", "ForceLaw")
    laws = [f"{getattr(force_laws, law.name).__module__}.{law.name}" for law in LAWS.values()]
    dynamics = {name: item for name, item in FUNCTIONS.items() if name.startswith("flexcam.dynamics.")}
    makers = [name for name, item in dynamics.items() if inspect.signature(item).return_annotation in made]
    assert len(makers) > 10
    assert not undocumented([(name, FUNCTIONS[name]) for name in (*laws, *makers)])


PUBLIC = {name: getattr(flexcam, name) for name in flexcam.__all__ if name != "LAWS"}


def test_public_names_document_every_parameter():
    wanted = {n: fields(i) if inspect.isclass(i) else [p.name for p in parameters(i)] for n, i in PUBLIC.items()}
    assert {name: documented(item) for name, item in PUBLIC.items()} == wanted


def public_methods(kind):
    """Return the methods that users of a class call, its bases' among them."""
    found = [(name, inspect.getattr_static(kind, name)) for name in dir(kind) if not name.startswith("_")]
    functions = [(name, getattr(raw, "__func__", raw)) for name, raw in found]
    return [(name, item) for name, item in functions if inspect.isfunction(item)]


METHODS_OF_PUBLIC = [
    (f"{public}.{name}", item)
    for public, kind in PUBLIC.items()
    if inspect.isclass(kind) and not issubclass(kind, BaseException)
    for name, item in public_methods(kind)
]


def test_methods_of_public_classes_document_every_parameter():
    assert not undocumented(METHODS_OF_PUBLIC)


def test_public_names_have_an_example():
    bare = [name for name, item in PUBLIC.items() if not section(inspect.getdoc(item) or "", "Examples")]
    assert [name for name in bare if not name.endswith("Error")] == []


def test_an_unknown_keyword_is_refused():
    """A misspelled option must never be swallowed."""
    for function in filter(inspect.isfunction, PUBLIC.values()):
        needed = sum(p.default is p.empty and p.kind is not p.KEYWORD_ONLY for p in parameters(function))
        with pytest.raises(TypeError, match="nosuch"):
            function(*[None] * needed, nosuch=1)
