"""Runs with a given solver engine."""

from __future__ import annotations

from dataclasses import replace

from flexcam.core.errors import InputError
from flexcam.dynamics import EngineName, Method, Problem, Response, SaveAt, newmark, solve
from flexcam.dynamics.engine_selection import select_engine

ENGINES: tuple[EngineName, ...] = ("auto", "kernel", "direct")
"""The automatic selection, the compiled engine, and the engine for every system."""


def available_engines(problem: Problem, method: Method | None = None) -> dict[str, bool]:
    """Return the engines that can solve a problem; True for the automatic selection."""
    found: dict[str, bool] = {}
    for engine in ENGINES:
        try:
            selected = select_engine(replace(problem, engine=engine), method or newmark()).engine
        except InputError:
            continue
        found.setdefault(selected, engine == "auto")
    return found


def run_engine(
    problem: Problem, engine: EngineName = "auto", save: SaveAt | None = None, method: Method | None = None
) -> Response:
    """Solve a problem with an engine."""
    return solve(replace(problem, engine=engine), method or newmark(), save=save)
