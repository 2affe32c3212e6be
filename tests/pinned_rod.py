"""A pinned tube with geometric stiffness, free to shorten, as a case: columns, bows, idle planes are tried on it."""

from __future__ import annotations

from flexcam.fem.sections import Section

LENGTH, TUBE = 0.4, Section.tube(0.008, 0.005)

_ROD = """
format = 1
[nodes]
root = [0.0, 0.0, 0.0]
mid = [0.2, 0.0, 0.0]
tip = [0.4, 0.0, 0.0]
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
tube = {{ shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }}
[members.rod]
nodes = ["root", "mid", "tip"]
material = "steel"
section = "tube"
elements = {elements}
rotary_inertia = {rotary}
geometric_stiffness = true
bow = {bow!r}
[supports]
root = ["ux", "uy", "uz", "rx"]
tip = ["uy", "uz"]
{loads}
[run]
{run}
start = "equilibrium"
[output]
probes = ["mid", "tip"]
"""
_SHORT = 'speed = "60 rpm"\nstep = "10 us"\nrevolutions = 3e-5'


def push(force: float) -> str:
    """Return the lines of a load along the tube at its tip, N; below zero it presses."""
    return _load("push", "tip", "ux", force)


def across(force: float) -> str:
    """Return the lines of a load across the tube at its middle, N."""
    return _load("across", "mid", "uy", force)


def _load(name: str, at: str, direction: str, force: float) -> str:
    return f'[loads.{name}]\nat = "{at}"\ndirection = "{direction}"\nforce = {force!r}\n'


def pinned_rod(
    bow: float, loads: str = "", *, elements: int = 4, rotary_inertia: bool = False, run: str = _SHORT
) -> str:
    """Return the text of the case: bow in m, elements from an end to the middle, lines of loads and of its run."""
    rotary = str(rotary_inertia).lower()
    return _ROD.format(bow=bow, loads=loads, elements=elements, rotary=rotary, run=run)
