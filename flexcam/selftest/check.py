"""A number against the one it must be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """A computed number beside its reference.

    Parameters
    ----------
    quantity
        What it is.
    source
        Where the reference comes from.
    reference, computed
        SI, or as `unit` says.
    tolerance
        Largest error that passes, as a part of the reference; absolute where that is zero.
    unit
        Of both numbers.
    """

    quantity: str
    source: str
    reference: float
    computed: float
    tolerance: float
    unit: str = "1"

    @property
    def error(self) -> float:
        """Distance from the reference, as a part of it; absolute where that is zero."""
        return abs(self.computed - self.reference) / (abs(self.reference) or 1.0)

    @property
    def passed(self) -> bool:
        """Whether the error is within its tolerance; what is no number is not."""
        return self.error <= self.tolerance
