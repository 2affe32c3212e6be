"""Whether an installation computes what it must: closed forms, published digits, and results against themselves.

Needs nothing but the installed package. May import `fidelity` and everything below it. A new check is a `Check` that
one of the files yields.
"""

from flexcam.selftest.all_checks import checks
from flexcam.selftest.check import Check
from flexcam.selftest.installation import installed

__all__ = ["Check", "checks", "installed"]
