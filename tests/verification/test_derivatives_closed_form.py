"""Derivatives of frequencies, static results, norms of runs and Floquet multipliers against closed forms.

The closed forms are in `benchmarks.measure.derivatives`, derived there by the complex step; Mathieu's multiplier
follows from the complex equation, integrated with DOP853 at 1e-13.
"""

import pytest

from benchmarks.measure import derivatives

REASONS = {
    "frequency.1": "rounding",
    "static.probes.mass.ux.displacement": "Richardson's extrapolation over 1 % of the stiffness",
    "multiplier.1": "period error of 1800 steps",
}

FIXED_OVERRIDES = {"probes": ("run.engine=kernel",), "multiplier": ("run.steps_per_revolution=1800",)}


@pytest.mark.parametrize("check", derivatives.CHECKS, ids=lambda check: check.scalar)
def test_derivatives_match_closed_forms(record, monkeypatch, check):
    monkeypatch.setattr(derivatives, "REPEATS", 1)
    fixed = FIXED_OVERRIDES.get(check.scalar.partition(".")[0], ())
    found = derivatives.measure(check._replace(fixed=fixed))
    for method in ("exact", "differences"):
        record(source="Derivatives in closed form", case=check.what, quantity=f"relative error, --method {method}",
               unit="1", reference=0.0, computed=found[f"{method}_error"], tolerance=check.tolerance, absolute=True,
               reason=REASONS.get(check.scalar, "average acceleration at 3600 steps per revolution"))  # fmt: skip
