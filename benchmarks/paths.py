"""A run by a chosen path of the time loop."""

from __future__ import annotations

import inspect

from flexcam.integrate import Method, Problem, SaveAt, newmark, solve
from flexcam.response import Response

PATHS = ("auto", "general", "modal", "compiled")
CHOICE = "path" in inspect.signature(solve).parameters
"""Whether `solve` has more than the general path."""


def there(path: str) -> bool:
    """Tell whether this flexcam has a path."""
    return CHOICE or path in ("auto", "general")


def solved(problem: Problem, path: str = "auto", save: SaveAt | None = None, scheme: Method | None = None) -> Response:
    """Solve by a path."""
    if CHOICE:
        return solve(problem, scheme or newmark(), save=save, path=path)
    if not there(path):
        message = f"path {path!r} of this flexcam: it has the general one alone"
        raise NotImplementedError(message)
    return solve(problem, scheme or newmark(), save=save)


def used(response: Response) -> str:
    """Return the path a run took."""
    return getattr(response.stats, "path", "general")
