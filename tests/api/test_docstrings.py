"""Public functions and classes have annotations, no **kwargs, and docstrings whose parameters match the signature."""

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


def public_members(module, kind):
    """Return the public functions or classes that a module defines, by their full names."""
    return {
        f"{module.__name__}.{name}": item
        for name, item in vars(module).items()
        if not name.startswith("_") and kind(item) and getattr(item, "__module__", None) == module.__name__
    }


FUNCTIONS = {name: item for module in MODULES for name, item in public_members(module, inspect.isfunction).items()}
CLASSES = {name: item for module in MODULES for name, item in public_members(module, inspect.isclass).items()}
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


def documented_parameters(item):
    """Return the names of the section Parameters, in order."""
    body = section(inspect.getdoc(item) or "", "Parameters")
    if body is None:
        return []
    heads = [line.partition(" :")[0] for line in body.splitlines() if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def parameters(item):
    return [p for p in inspect.signature(item).parameters.values() if p.name not in ("self", "cls")]


def annotation_faults(function):
    """Return parameters without annotation and parameters that accept unknown keywords."""
    lacking = [p.name for p in parameters(function) if p.annotation is p.empty]
    lacking += ["return"] if inspect.signature(function).return_annotation is inspect.Signature.empty else []
    return lacking + [f"**{p.name}" for p in parameters(function) if p.kind is p.VAR_KEYWORD]


def test_package_has_public_functions_and_classes():
    assert len(FUNCTIONS) > 80
    assert len(CLASSES) > 40
    assert len(METHODS) > 40


def test_functions_are_annotated_without_kwargs():
    faults = {name: annotation_faults(item) for name, item in (FUNCTIONS | METHODS).items() if annotation_faults(item)}
    assert not faults


def test_public_functions_have_docstrings():
    assert not [name for name, item in (FUNCTIONS | METHODS).items() if not (inspect.getdoc(item) or "").strip()]


def fields(kind):
    if dataclasses.is_dataclass(kind):
        return [f.name for f in dataclasses.fields(kind) if f.init]
    return [p.name for p in parameters(kind.__init__)] if "__init__" in vars(kind) else []


SHARED = {
    "x", "v", "stiffness", "damping", "x_begin", "state", "step", "constants", "b", "i", "local", "tangent",
}  # fmt: skip
"""Parameters of force laws, which the docstring of `flexcam.dynamics.force_laws` describes."""
OF_LAWS = {"force_laws", "oil_laws", "law_data"}


def documentation_mismatches(items):
    """Return the functions whose section Parameters differs from the signature, with both."""
    shared = {name: SHARED if OF_LAWS.intersection(name.split(".")) else set() for name, _ in items}
    both = {
        n: (documented_parameters(item), [p.name for p in parameters(item) if p.name not in shared[n]])
        for n, item in items
    }
    return {name: pair for name, pair in both.items() if pair[0] != pair[1]}


def test_documented_parameters_match_signature():
    """A docstring need not list the parameters; if it does, it lists all of them."""
    items = [
        (name, item)
        for name, item in (FUNCTIONS | METHODS).items()
        if documented_parameters(item) and ".cli." not in name
    ]
    assert len(items) > 50
    assert not documentation_mismatches(items)


def test_documented_fields_match_constructor():
    """A base class documents its own fields, so that a class may list only those that it declares itself."""
    kinds = {name: kind for name, kind in CLASSES.items() if documented_parameters(kind)}
    declared = {
        name: [f for f in fields(kind) if f in vars(kind).get("__annotations__", {})] for name, kind in kinds.items()
    }
    assert kinds
    assert not [
        name for name, kind in kinds.items() if documented_parameters(kind) not in (fields(kind), declared[name])
    ]


def test_elements_document_parameters_and_returns():
    items = {name: item for name, item in FUNCTIONS.items() if name.startswith("flexcam.fem.elements.")}
    assert items
    assert not documentation_mismatches(items.items())
    returning = {n: f for n, f in items.items() if inspect.signature(f).return_annotation not in ("None", None)}
    assert not [name for name, item in returning.items() if not section(inspect.getdoc(item) or "", "Returns")]


def test_integrators_and_laws_document_all_parameters():
    made = ("Scheme", "Bathe", "CentralDifference", "Collocation", "ScipyIntegrator", "ForceLaw")
    laws = [f"{getattr(force_laws, law.name).__module__}.{law.name}" for law in LAWS.values()]
    dynamics = {name: item for name, item in FUNCTIONS.items() if name.startswith("flexcam.dynamics.")}
    makers = [name for name, item in dynamics.items() if inspect.signature(item).return_annotation in made]
    assert len(makers) > 10
    assert not documentation_mismatches([(name, FUNCTIONS[name]) for name in (*laws, *makers)])


PUBLIC = {name: getattr(flexcam, name) for name in flexcam.__all__ if name != "LAWS"}


def test_public_names_document_all_parameters():
    wanted = {n: fields(i) if inspect.isclass(i) else [p.name for p in parameters(i)] for n, i in PUBLIC.items()}
    assert {name: documented_parameters(item) for name, item in PUBLIC.items()} == wanted


def public_methods(kind):
    """Return the methods that users of a class can call, including those of its bases."""
    found = [(name, inspect.getattr_static(kind, name)) for name in dir(kind) if not name.startswith("_")]
    functions = [(name, getattr(raw, "__func__", raw)) for name, raw in found]
    return [(name, item) for name, item in functions if inspect.isfunction(item)]


METHODS_OF_PUBLIC = [
    (f"{public}.{name}", item)
    for public, kind in PUBLIC.items()
    if inspect.isclass(kind) and not issubclass(kind, BaseException)
    for name, item in public_methods(kind)
]


def test_public_methods_document_all_parameters():
    assert not documentation_mismatches(METHODS_OF_PUBLIC)


def test_public_names_have_examples():
    bare = [name for name, item in PUBLIC.items() if not section(inspect.getdoc(item) or "", "Examples")]
    assert [name for name in bare if not name.endswith("Error")] == []


def test_unknown_keyword_is_refused():
    """A misspelt option must raise an error."""
    for function in filter(inspect.isfunction, PUBLIC.values()):
        needed = sum(p.default is p.empty and p.kind is not p.KEYWORD_ONLY for p in parameters(function))
        with pytest.raises(TypeError, match="nosuch"):
            function(*[None] * needed, nosuch=1)
