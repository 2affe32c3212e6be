"""Expected behaviour at extremes: a correct result, a warning with its number, or a refusal with its cause.

`expect` asserts it and stores a row; `docs/make_extremes.py` makes the page of these rows.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command import Ended

ROOT = Path(__file__).parents[2]


class Expected:
    """Assert the expected behaviour at an extreme and store the row.

    The row of a test marked xfail gives the expected behaviour and states that it is not yet reached.
    """

    def __init__(self, test: str, missing: str, rows: list[dict[str, object]]) -> None:
        self._test, self._missing, self._rows = test, missing, rows

    def right(
        self, extreme: str, given: str, *, what: str, reference: float, computed: float, tolerance: float,
        absolute: bool = False, unit: str = "",
    ) -> None:  # fmt: skip
        """Expect |computed - reference| <= tolerance |reference|, or tolerance where absolute."""
        allowed = tolerance if absolute else tolerance * abs(reference)
        off = abs(float(computed) - float(reference))
        holds = bool(off <= allowed)  # False for NaN
        share = off if absolute or not reference else off / abs(reference)
        size = f"{_one_digit(share)}{unit if absolute else ''}"
        happens = f"{what} {float(reference):.6g}{unit}, met within {size}" if reference else f"{what} {size}"
        self._keep(extreme, given, "right", happens, holds)
        assert holds, f"{given}, {what}: {computed:.10g}, theory {reference:.10g}, allowed +-{allowed:.3g}"

    def warns(self, extreme: str, given: str, message: str, *patterns: str) -> None:
        """Expect a run with a warning that matches all patterns, such as the number of lost digits."""
        self._words(extreme, given, "warns", message, patterns)

    def refuses(self, extreme: str, given: str, message: str, *patterns: str) -> None:
        """Expect a refusal whose message matches all patterns."""
        self._words(extreme, given, "refuses", message, patterns)

    def _words(self, extreme: str, given: str, outcome: str, message: str, patterns: tuple[str, ...]) -> None:
        message = " ".join(message.split())
        missing = [pattern for pattern in patterns if not re.search(pattern, message)]
        self._keep(extreme, given, outcome, message if not missing else "", not missing)
        assert not missing, f"{given}: {message!r} does not match {missing}"

    def _keep(self, extreme: str, given: str, outcome: str, happens: str, holds: bool) -> None:
        self._rows.append({
            "extreme": extreme, "given": given, "outcome": outcome, "happens": happens if holds else self._missing,
            "holds": holds, "known": bool(self._missing), "test": self._test, "place": f"{len(self._rows):04}",
        })  # fmt: skip


def _one_digit(share: float) -> str:
    """Return a deviation to one digit; further digits differ between machines."""
    return "0" if not share else "1e-14" if share < 1e-14 else f"{share:.0e}"


@pytest.fixture
def expect(request: pytest.FixtureRequest, page_rows: Callable[[str], list[dict[str, object]]]) -> Expected:
    """Return the object that asserts the expected behaviour and stores the row."""
    marker = request.node.get_closest_marker("xfail")
    return Expected(request.node.nodeid, marker.kwargs["reason"] if marker else "", page_rows("extremes"))


@pytest.fixture
def command(flexcam: Callable[..., Ended]) -> Callable[..., tuple[int, str]]:
    """Return a function that runs the command in this process and its own folder; it returns exit code and output."""

    def run(*words: object) -> tuple[int, str]:
        ended = flexcam(*words)
        return ended.code, ended.out + ended.err

    return run


@pytest.fixture(scope="session")
def tayeb() -> Path:
    """Return the path of the published case."""
    return ROOT / "cases/tayeb/model-3-shm.toml"
