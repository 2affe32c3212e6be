"""A run by a chosen way through time."""

from __future__ import annotations

from dataclasses import replace

from flexcam.integrate import Method, Problem, SaveAt, newmark, solve
from flexcam.integrate.paths import way_of
from flexcam.integrate.problem import Path
from flexcam.response import Response

BOTH: tuple[Path, ...] = ("auto", "general")
"""The way flexcam takes, and the one that fits every system."""


def taken(problem: Problem, scheme: Method | None = None, save: SaveAt | None = None) -> str:
    """Return the path that flexcam takes by itself."""
    return way_of(replace(problem, path="auto"), scheme or newmark(), save or SaveAt()).path


def ways(automatic: str) -> dict[str, bool]:
    """Return the ways to be measured, the one flexcam takes and the general one, and which of them is automatic."""
    return {automatic: True} | ({} if automatic == "general" else {"general": False})


def solved(problem: Problem, path: str = "auto", save: SaveAt | None = None, scheme: Method | None = None) -> Response:
    """Solve by a path."""
    return solve(replace(problem, path=path), scheme or newmark(), save=save)
