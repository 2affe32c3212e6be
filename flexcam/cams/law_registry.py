"""Registry of motion laws: complete laws, laws with parameters, and laws of other packages.

A package adds laws by entry points of the group ``flexcam.laws``: a name and a class or function that returns a `Law`;
its annotated parameters (numbers, or tuples of numbers) can be given in a case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from types import MappingProxyType

from flexcam.cams.motion_law import Law
from flexcam.cams.polynomial_laws import BSplineLaw, Polynomial, quinquinomial, through_points
from flexcam.cams.standard_laws import (
    FREUDENSTEIN,
    GUTMAN,
    PAVLOVIC_NEW,
    PAVLOVIC_TRIGONOMETRIC,
    CompoundCycloid,
    CosineSum,
    Harmonic,
    Scca,
    harmonic_acceleration,
)
from flexcam.core.errors import refuse

LawKind = Callable[..., Law]
"""Class or function whose parameters are those of a law."""

LAWS: Mapping[str, Law] = MappingProxyType(
    {
        "shm": CosineSum((0.5, -0.5)),
        "cos": CosineSum((0.5, -0.5)),
        "parabolic": Scca(0.0, 1.0, 0.0),
        "cycloidal": Harmonic(((1, 1.0),)),
        "modified-trapezoid": Scca(0.25, 0.5, 0.25),
        "modified-sine": Scca(0.25, 0.0, 0.75),
        "2-3": Polynomial((2, 3)),
        "3-4-5": Polynomial((3, 4, 5)),
        "4-5-6-7": Polynomial((4, 5, 6, 7)),
        "5-6-7-8-9": Polynomial((5, 6, 7, 8, 9)),
        "gutman-1-3": GUTMAN,
        "freudenstein-1-3": FREUDENSTEIN,
        "pavlovic-trigonometric": PAVLOVIC_TRIGONOMETRIC,
        "pavlovic-new": PAVLOVIC_NEW,
        "quinquinomial": quinquinomial(1),
        "quinquinomial-2": quinquinomial(2),
        "quinquinomial-3": quinquinomial(3),
        "quinquinomial-4": quinquinomial(4),
        "harmonic-acceleration": harmonic_acceleration(),
        "fb2": CompoundCycloid(),
    }
)
"""Complete laws by name. ``cos`` is the name F. I. T. Petrescu uses for the simple harmonic law."""

KINDS: Mapping[str, LawKind] = MappingProxyType(
    {
        "scca": Scca,
        "polynomial": Polynomial,
        "quinquinomial": quinquinomial,
        "harmonic": Harmonic,
        "harmonic-acceleration": harmonic_acceleration,
        "cosine": CosineSum,
        "fb2": CompoundCycloid,
        "bspline": BSplineLaw,
        "table": through_points,
    }
)
"""Kinds of law with parameters, by id."""

GROUP = "flexcam.laws"


_IMPORT_ERRORS = (
    ArithmeticError, AttributeError, ImportError, LookupError, NameError, OSError, RuntimeError, SyntaxError, TypeError,
    ValueError,
)  # fmt: skip
"""Exceptions that importing a module of another package may raise."""


def kind_names() -> tuple[str, ...]:
    """Return the ids of all kinds of law, those of installed packages last, without loading these.

    Examples
    --------
    >>> kind_names()[:2]
    ('scca', 'polynomial')
    """
    return tuple(dict.fromkeys([*KINDS, *(point.name for point in entry_points(group=GROUP))]))


def law_kind(name: str) -> LawKind | None:
    """Return a kind of law by its id; built-in kinds take precedence, and only the requested package is loaded.

    Examples
    --------
    >>> law_kind("scca").__name__
    'Scca'
    """
    if name in KINDS:
        return KINDS[name]
    point = next((entry for entry in entry_points(group=GROUP) if entry.name == name), None)
    if point is None:
        return None
    try:
        return point.load()
    except _IMPORT_ERRORS as fault:
        package = point.dist.name if point.dist else point.value
        why = f"the package {package}, which defines it, failed: {type(fault).__name__}: {fault}"
        raise refuse("law", repr(name), "a law that can be loaded", why, f"correct or remove {package}") from None
