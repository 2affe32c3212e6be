"""Whether an installation computes what it must: closed forms, published digits, and results against themselves.

Needs nothing but the installed package. May import `fidelity` and everything below it. A new check is a `Check` that
one of the files yields.
"""

from collections.abc import Iterator

from flexcam.selftest.check import Check
from flexcam.selftest.installation import installed
from flexcam.selftest.oscillators import oscillators
from flexcam.selftest.structures import structures
from flexcam.selftest.trains import trains

__all__ = ["Check", "checks", "installed"]


def checks() -> Iterator[Check]:
    """Yield all checks, each as it is computed."""
    yield from structures()
    yield from oscillators()
    yield from trains()
