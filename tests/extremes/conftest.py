"""What is expected of an extreme: the right answer, a warning with its number, or a refusal with its cause.

`expect` asserts it and keeps it as a row; `docs/make_extremes.py` makes the page of these rows.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command import Ended

ROOT = Path(__file__).parents[2]


class Expected:
    """Asserts what is expected of an extreme and keeps the row.

    Where a test is marked xfail, the row says what is expected and that it is not so yet.
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

    def warns(self, extreme: str, given: str, said: str, *patterns: str) -> None:
        """Expect a run that goes on, and words that match all patterns (the number of what is lost among them)."""
        self._words(extreme, given, "warns", said, patterns)

    def refuses(self, extreme: str, given: str, said: str, *patterns: str) -> None:
        """Expect a refusal whose words match all patterns."""
        self._words(extreme, given, "refuses", said, patterns)

    def _words(self, extreme: str, given: str, outcome: str, said: str, patterns: tuple[str, ...]) -> None:
        said = " ".join(said.split())
        missing = [pattern for pattern in patterns if not re.search(pattern, said)]
        self._keep(extreme, given, outcome, said if not missing else "", not missing)
        assert not missing, f"{given}: {said!r} says nothing of {missing}"

    def _keep(self, extreme: str, given: str, outcome: str, happens: str, holds: bool) -> None:
        self._rows.append({
            "extreme": extreme, "given": given, "outcome": outcome, "happens": happens if holds else self._missing,
            "holds": holds, "known": bool(self._missing), "test": self._test, "place": f"{len(self._rows):04}",
        })  # fmt: skip


def _one_digit(share: float) -> str:
    """Return a deviation to one digit: the next ones differ between machines."""
    return "0" if not share else "1e-14" if share < 1e-14 else f"{share:.0e}"


@pytest.fixture
def expect(request: pytest.FixtureRequest, page_rows: Callable[[str], list[dict[str, object]]]) -> Expected:
    """Assert what is expected of an extreme and keep the row."""
    marker = request.node.get_closest_marker("xfail")
    return Expected(request.node.nodeid, marker.kwargs["reason"] if marker else "", page_rows("extremes"))


@pytest.fixture
def command(flexcam: Callable[..., Ended]) -> Callable[..., tuple[int, str]]:
    """Run the command in this process and a folder of its own; return exit code and all it said."""

    def run(*words: object) -> tuple[int, str]:
        ended = flexcam(*words)
        return ended.code, ended.out + ended.err

    return run


@pytest.fixture(scope="session")
def tayeb() -> Path:
    """Return the published case."""
    return ROOT / "cases/tayeb/model-3-shm.toml"
