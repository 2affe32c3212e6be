"""Linear elastic, isotropic material."""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexcam.checks import positive, refuse


@dataclass(frozen=True)
class Material:
    """Isotropic material.

    Parameters
    ----------
    E
        Young's modulus, Pa.
    nu
        Poisson's ratio, -1 < nu <= 0.5.
    density
        Mass per volume, kg/m^3; zero makes the member massless.
    ultimate_strength, endurance_limit
        Pa, for the margin against fatigue; None where they are not stated.

    Raises
    ------
    InputError
        If a value is outside its range.

    Examples
    --------
    >>> round(Material(E=207e9, nu=0.29, density=7800.0).G / 1e9, 2)
    80.23
    """

    E: float
    nu: float
    density: float
    ultimate_strength: float | None = None
    endurance_limit: float | None = None

    def __post_init__(self) -> None:
        positive("E", self.E, "Pa")
        positive("density", self.density, "kg/m^3", zero=True)
        for name in ("ultimate_strength", "endurance_limit"):
            if (strength := getattr(self, name)) is not None:
                positive(name, strength, "Pa")
        if (self.endurance_limit or 0.0) > (self.ultimate_strength or math.inf):
            given = f"{self.endurance_limit:g} Pa"
            allowed = f"up to the ultimate strength, {self.ultimate_strength:g} Pa"
            raise refuse("endurance_limit", given, allowed, "no amplitude is borne for ever that breaks it at once")
        if not -1.0 < self.nu <= 0.5:
            raise refuse("nu", self.nu, "above -1 and up to 0.5", "the shear modulus E/(2(1+nu)) must be positive")

    @property
    def G(self) -> float:  # noqa: N802 - the books' letter
        """Shear modulus E/(2(1+nu)), Pa."""
        return self.E / (2.0 * (1.0 + self.nu))
