"""Materials and cross-sections."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from flexcam.core.errors import positive, refuse


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
        Pa, for the margin against fatigue; None if not given.
    expansion
        Coefficient of linear thermal expansion, 1/K.

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
    expansion: float = 0.0

    def __post_init__(self) -> None:
        positive("E", self.E, "Pa")
        positive("density", self.density, "kg/m^3", zero=True)
        for name in ("ultimate_strength", "endurance_limit"):
            if (strength := getattr(self, name)) is not None:
                positive(name, strength, "Pa")
        if (self.endurance_limit or 0.0) > (self.ultimate_strength or math.inf):
            given = f"{self.endurance_limit:g} Pa"
            allowed = f"up to the ultimate strength, {self.ultimate_strength:g} Pa"
            raise refuse("endurance_limit", given, allowed, "the endurance limit cannot exceed the strength")
        if not -1.0 < self.nu <= 0.5:
            raise refuse(
                "nu", self.nu, "a value above -1 and up to 0.5", "the shear modulus E/(2(1+nu)) must be positive"
            )

    @property
    def G(self) -> float:  # noqa: N802 - the books' letter
        """Shear modulus E/(2(1+nu)), Pa."""
        return self.E / (2.0 * (1.0 + self.nu))


_COWPER_NU = 0.3  # a change of nu from 0.25 to 0.35 moves kappa of a circle by 1 %


@dataclass(frozen=True)
class Section:
    """Cross-section with its principal axes along the member's local y and z.

    Parameters
    ----------
    A
        Area, m^2.
    Iy, Iz
        Second moments about local y and z, m^4: Iz resists bending in the local x-y plane.
    J
        Saint-Venant torsion constant, m^4 (the torsional inertia uses the polar moment Iy + Iz).
    kappa_y, kappa_z
        Shear factors for forces along local y and z; used by members with shear deformation.
    fibre_y, fibre_z
        Distance of the extreme fibre from the axis along local y and z, m; if zero, twice the radius of gyration, which
        is exact for a solid circle and conservative for solid sections, but not for open profiles.
    torsion_arm
        Length c such that the largest torsional shear stress is T c/J, m; if zero, twice the smaller fibre distance,
        which is conservative for compact sections.
    radius
        Radius for drawing, m; if zero, that of the circle of equal area.
    round
        Whether the extreme fibres lie on a circle (else at the corners of a rectangle).

    Raises
    ------
    InputError
        If a value is not positive.

    Examples
    --------
    >>> round(Section.circle(0.025).J * 1e9, 3)
    38.35
    """

    A: float
    Iy: float
    Iz: float
    J: float
    kappa_y: float = 1.0
    kappa_z: float = 1.0
    fibre_y: float = 0.0
    fibre_z: float = 0.0
    torsion_arm: float = 0.0
    radius: float = 0.0
    round: bool = False

    def __post_init__(self) -> None:
        for name, unit in (("A", "m^2"), ("Iy", "m^4"), ("Iz", "m^4"), ("J", "m^4"), ("kappa_y", ""), ("kappa_z", "")):
            positive(name, getattr(self, name), unit)
        for name in ("fibre_y", "fibre_z", "torsion_arm", "radius"):
            positive(name, getattr(self, name), "m", zero=True)
        fibre_y = self.fibre_y or 2.0 * math.sqrt(self.Iz / self.A)
        fibre_z = self.fibre_z or 2.0 * math.sqrt(self.Iy / self.A)
        object.__setattr__(self, "fibre_y", fibre_y)
        object.__setattr__(self, "fibre_z", fibre_z)
        object.__setattr__(self, "torsion_arm", self.torsion_arm or 2.0 * min(fibre_y, fibre_z))
        object.__setattr__(self, "radius", self.radius or math.sqrt(self.A / math.pi))

    @classmethod
    def circle(cls, diameter: float) -> Self:
        """Return a solid round section.

        Parameters
        ----------
        diameter
            m.

        Returns
        -------
        Section
            With the shear factor of Cowper (1966) for a round bar.

        Raises
        ------
        InputError
            If the diameter is not above zero.
        """
        return cls.tube(diameter, 0.0)

    @classmethod
    def tube(cls, outer_diameter: float, inner_diameter: float) -> Self:
        """Return a round tube.

        Parameters
        ----------
        outer_diameter, inner_diameter
            Diameters, m; an inner diameter of zero gives a solid bar.

        Returns
        -------
        Section
            With the shear factor of Cowper (1966) for a round tube.

        Raises
        ------
        InputError
            If the inner diameter is not below the outer one.
        """
        outer = positive("outer_diameter", outer_diameter, "m") / 2.0
        inner = positive("inner_diameter", inner_diameter, "m", zero=True) / 2.0
        if inner >= outer:
            given, allowed = (
                f"{1e3 * inner_diameter:g} mm",
                f"a value below outer_diameter, {1e3 * outer_diameter:g} mm",
            )
            raise refuse("inner_diameter", given, allowed)
        second = math.pi * (outer**4 - inner**4) / 4.0
        nu, square = _COWPER_NU, (1.0 + (inner / outer) ** 2) ** 2
        kappa = 6.0 * (1.0 + nu) * square / ((7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * (inner / outer) ** 2)
        area = math.pi * (outer**2 - inner**2)
        return cls(
            A=area, Iy=second, Iz=second, J=2.0 * second, kappa_y=kappa, kappa_z=kappa,
            fibre_y=outer, fibre_z=outer, torsion_arm=outer, radius=outer, round=True,
        )  # fmt: skip

    @classmethod
    def rectangle(cls, width_y: float, width_z: float) -> Self:
        """Return a rectangular section.

        Parameters
        ----------
        width_y, width_z
            Sides along local y and z, m.

        Returns
        -------
        Section
            With the shear factor 5/6.

        Raises
        ------
        InputError
            If a side is not above zero.
        """
        h, b = positive("width_y", width_y, "m"), positive("width_z", width_z, "m")
        J, arm = _rectangle_torsion(b, h)
        return cls(
            A=b * h, Iy=h * b**3 / 12.0, Iz=b * h**3 / 12.0, J=J, kappa_y=5.0 / 6.0, kappa_z=5.0 / 6.0,
            fibre_y=h / 2.0, fibre_z=b / 2.0, torsion_arm=arm, radius=math.hypot(b, h) / 2.0,
        )  # fmt: skip

    def at(self, share: float) -> Section:
        """Return the section at a share of the member's length: itself, as `Taper.at` for a tapered member.

        Parameters
        ----------
        share
            From 0 at the first node to 1 at the last.

        Returns
        -------
        Section
            The same everywhere.
        """
        del share
        return self


@dataclass(frozen=True)
class Taper:
    """Section of a member whose dimensions vary linearly over its length.

    Examples
    --------
    >>> Taper(Section.circle, (0.010,), (0.006,)).at(0.5).radius
    0.004
    """

    shape: Callable[..., Section]  #: function of the dimensions, such as `Section.tube`
    #: `start`, `end`: its arguments at the first and at the last node, m
    start: tuple[float, ...]
    end: tuple[float, ...]
    given: Mapping[str, float] = field(default_factory=dict[str, float])  #: properties in place of those of the shape

    def __post_init__(self) -> None:
        for share in (0.0, 1.0):
            self.at(share)

    def at(self, share: float) -> Section:
        """Return the section at a share of the member's length, from 0 at the first node to 1 at the last."""
        sizes = (a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))
        return replace(self.shape(*sizes), **self.given)


_ODD_FIFTH_POWERS = 31.0 / 32.0 * 1.0369277551433699263  # sum of 1/n^5 over odd n, (1 - 2^-5) zeta(5)


def _rectangle_torsion(side: float, other: float) -> tuple[float, float]:
    """Return Saint-Venant's torsion constant and the length c of tau = T c/J at the middle of the long side.

    J = a b^3 (1/3 - 64 b/(pi^5 a) sum tanh(n pi a/2b)/n^5), c = b (1 - 8/pi^2 sum 1/(n^2 cosh(n pi a/2b))), n odd, a >=
    b.
    """
    a, b = max(side, other), min(side, other)
    terms = [(n, n * math.pi * a / (2.0 * b)) for n in range(1, 15, 2)]
    correction = math.fsum((1.0 - math.tanh(x)) / n**5 for n, x in terms)
    J = a * b**3 * (1.0 / 3.0 - 64.0 * b / (math.pi**5 * a) * (_ODD_FIFTH_POWERS - correction))
    return J, b * (1.0 - 8.0 / math.pi**2 * math.fsum(1.0 / (n**2 * math.cosh(min(x, 700.0))) for n, x in terms))
