"""A run by a chosen way through time."""

from __future__ import annotations

from dataclasses import replace

from flexcam.integrate import Method, Problem, SaveAt, newmark, solve
from flexcam.integrate.problem import Path
from flexcam.response import Response

BOTH: tuple[Path, ...] = ("auto", "general")
"""The way flexcam takes, and the one that fits every system."""


def solved(problem: Problem, path: str = "auto", save: SaveAt | None = None, scheme: Method | None = None) -> Response:
    """Solve by a path."""
    return solve(replace(problem, path=path), scheme or newmark(), save=save)
