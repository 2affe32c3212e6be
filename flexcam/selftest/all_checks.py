"""All checks of an installation."""

from __future__ import annotations

from collections.abc import Iterator

from flexcam.selftest.check import Check
from flexcam.selftest.oscillators import oscillators
from flexcam.selftest.structures import structures
from flexcam.selftest.trains import trains


def checks() -> Iterator[Check]:
    """Yield all checks, each as it is computed."""
    yield from structures()
    yield from oscillators()
    yield from trains()
