"""What the keys of a case usually hold: bounds of machines that exist, with room to spare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flexcam.units import RPM


@dataclass(frozen=True)
class Usual:
    """What a key usually holds.

    Parameters
    ----------
    key
        Its path, ``*`` for any name.
    what
        The quantity in the engineer's words.
    least, most
        SI.
    meant
        Units in which the number may have been meant, with their size in SI, the likeliest first.
    si
        Unit, where the key's place alone does not tell it.
    zero
        Whether zero is told as well.
    """

    key: str
    what: str
    least: float
    most: float
    meant: Mapping[str, float]
    si: str = ""
    zero: bool = False


_LENGTH = {"mm": 1e-3, "um": 1e-6, "in": 0.0254, "m": 1.0}
_STRESS = {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3}
_STIFF = {"kN/m": 1e3, "N/mm": 1e3, "MN/m": 1e6, "N/m": 1.0}
_INERTIA = {"g mm^2": 1e-9, "kg mm^2": 1e-6}
_MASS = {"g": 1e-3, "kg": 1.0}
_ANGULAR = {"rpm": RPM}

USUAL = (
    Usual("materials.*.E", "Young's modulus of a solid", 1e6, 1.5e12, _STRESS),
    Usual("materials.*.density", "density of a solid", 500.0, 2.5e4, {"g/cm^3": 1e3}, zero=True),
    Usual("materials.*.ultimate_strength", "strength", 1e5, 2e10, {"MPa": 1e6, "GPa": 1e9}),
    Usual("materials.*.endurance_limit", "strength", 1e5, 2e10, {"MPa": 1e6, "GPa": 1e9}),
    Usual("nodes.*", "coordinate of a machine", 0.0, 20.0, _LENGTH),
    Usual("sections.*.diameter", "diameter", 1e-5, 3.0, _LENGTH),
    Usual("sections.*.outer_diameter", "diameter", 1e-5, 3.0, _LENGTH),
    Usual("sections.*.inner_diameter", "diameter", 1e-5, 3.0, _LENGTH),
    Usual("sections.*.width_y", "width of a section", 1e-5, 3.0, _LENGTH),
    Usual("sections.*.width_z", "width of a section", 1e-5, 3.0, _LENGTH),
    Usual("sections.*.A", "area of a section", 1e-10, 10.0, {"mm^2": 1e-6, "cm^2": 1e-4}),
    Usual("sections.*.Iy", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    Usual("sections.*.Iz", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    Usual("sections.*.J", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    Usual("masses.*.mass", "mass in a valve train", 1e-7, 20.0, _MASS),
    Usual("masses.*.inertia", "inertia in a valve train", 1e-14, 1e5, _INERTIA),
    Usual("masses.*.offset", "offset of a mass", 0.0, 10.0, _LENGTH),
    Usual("springs.*.damping", "damping of a spring", 1e-9, 1e8, {"N s/mm": 1e3, "N s/m": 1.0}),
    Usual("springs.*.installed_force", "force of a spring", 1e-4, 1e6, {"N": 1.0, "mN": 1e-3}),
    Usual("springs.*.installed_compression", "travel of a spring", 1e-7, 2.0, _LENGTH),
    Usual("springs.*.clash_travel", "travel of a spring", 1e-7, 2.0, _LENGTH),
    Usual("springs.*.clash_stiffness", "stiffness of coils that touch", 10.0, 1e13, _STIFF),
    Usual("springs.*.mass", "mass of a spring", 1e-8, 20.0, _MASS),
    Usual("springs.*.wire.diameter", "diameter of a wire", 1e-6, 0.3, _LENGTH),
    Usual("springs.*.wire.coil_diameter", "diameter of a coil", 1e-5, 3.0, _LENGTH),
    Usual("springs.*.wire.shear_modulus", "shear modulus of a solid", 1e6, 1e12, _STRESS),
    Usual("bearings.*.stiffness", "stiffness of a bearing", 1.0, 1e13, _STIFF),
    Usual("loads.*.force", "force on a mechanism", 1e-6, 1e8, {"N": 1.0, "kN": 1e3}),
    Usual("rockers.*.arms", "arm of a rocker", 1e-4, 5.0, _LENGTH),
    Usual("rockers.*.inertia", "inertia of a rocker", 1e-14, 1e3, _INERTIA),
    Usual("rockers.*.stiffness", "stiffness of a rocker", 1.0, 1e13, _STIFF),
    Usual("cams.*.lift", "lift of a cam", 1e-6, 0.5, _LENGTH, "m"),
    Usual("cams.*.base_radius", "base radius", 1e-5, 2.0, _LENGTH),
    Usual("cams.*.width", "width of a cam", 1e-5, 2.0, _LENGTH),
    Usual("cams.*.ramps.height", "height of a ramp", 1e-8, 0.05, _LENGTH),
    Usual("cams.*.follower.radius", "radius of a roller", 1e-5, 2.0, _LENGTH),
    Usual("cams.*.follower.offset", "offset of a follower", 0.0, 2.0, _LENGTH),
    Usual("cams.*.follower.arm", "arm of a follower", 1e-4, 5.0, _LENGTH),
    Usual("cams.*.follower.distance", "distance of a pivot", 1e-4, 5.0, _LENGTH),
    Usual("contacts.*.stiffness", "stiffness of a contact", 10.0, 1e13, _STIFF),
    Usual("contacts.*.gap", "play", 1e-8, 0.02, _LENGTH),
    Usual("contacts.*.friction", "coefficient of friction", 0.0, 1.0, {"%": 0.01}),
    Usual("contacts.*.dissipation", "dissipation of a contact", 0.0, 1e4, {}),
    Usual("contacts.*.preload_factor", "factor of a preload", 0.0, 100.0, {}),
    Usual("contacts.*.plunger_force", "force of a plunger", 1e-3, 1e4, {"N": 1.0}),
    Usual("run.speed", "camshaft speed", 1e-3, 1250.0, _ANGULAR),
    Usual("run.crank_speed", "crankshaft speed", 1e-3, 2500.0, _ANGULAR),
    Usual("members.*.bow", "bow of a member", 0.0, 0.05, _LENGTH),
    Usual("run.damping.modal", "damping ratio", 0.0, 0.5, {"%": 0.01}),
    Usual("run.damping.alpha", "Rayleigh factor of the mass", 0.0, 1e5, {}),
    Usual("run.damping.beta", "Rayleigh factor of the stiffness", 0.0, 0.1, {"ms": 1e-3, "us": 1e-6}),
    Usual("run.gravity", "acceleration of gravity", 0.0, 100.0, {"mm/s^2": 1e-3}),
)  # fmt: skip
"""What is usual, by key."""

STRAIGHT = Usual("springs.*.stiffness", "stiffness of a spring", 100.0, 1e12, _STIFF, "N/m")
"""Of springs along a line: any that presses something on is stiffer, and 50 is hardly 50 N/m."""

TWISTED = Usual("springs.*.stiffness", "stiffness of a spring", 1e-3, 1e12, {"kN m/rad": 1e3}, "N m/rad")
"""Of springs that twist."""
