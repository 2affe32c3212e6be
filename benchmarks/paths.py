"""Runs on a chosen engine."""

from __future__ import annotations

from dataclasses import replace

from flexcam.core.errors import InputError
from flexcam.dynamics import EngineName, Method, Problem, Response, SaveAt, newmark, solve
from flexcam.dynamics.engine_selection import select_engine

ALL: tuple[EngineName, ...] = ("auto", "kernel", "direct")
"""The engine that flexcam selects, the compiled one, and the one that fits every system."""


def taken(problem: Problem, path: EngineName, scheme: Method | None = None, save: SaveAt | None = None) -> str | None:
    """Return the engine that flexcam takes when it is asked for one; None if it cannot."""
    try:
        return select_engine(replace(problem, engine=path), scheme or newmark(), save or SaveAt()).engine
    except InputError:
        return None


def ways(problem: Problem, scheme: Method | None = None, save: SaveAt | None = None) -> dict[str, bool]:
    """Return the engines to be measured, and which of them is automatic."""
    found = {path: taken(problem, path, scheme, save) for path in ALL}
    return {path: path == found["auto"] for path in found.values() if path is not None}


def solved(
    problem: Problem, path: EngineName = "auto", save: SaveAt | None = None, scheme: Method | None = None
) -> Response:
    """Solve on an engine."""
    return solve(replace(problem, engine=path), scheme or newmark(), save=save)
