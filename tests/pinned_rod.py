"""Case of a pinned tube with geometric stiffness and free axial motion, for tests of columns, bows and planes."""

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
    """Return the case text of an axial load at the tip, N, negative for compression."""
    return _load("push", "tip", "ux", force)


def across(force: float) -> str:
    """Return the case text of a transverse load in the middle, N."""
    return _load("across", "mid", "uy", force)


def _load(name: str, at: str, direction: str, force: float) -> str:
    return f'[loads.{name}]\nat = "{at}"\ndirection = "{direction}"\nforce = {force!r}\n'


def pinned_rod(
    bow: float, loads: str = "", *, elements: int = 4, rotary_inertia: bool = False, run: str = _SHORT
) -> str:
    """Return the case text, with bow in m, number of elements per half, and texts of loads and run."""
    rotary = str(rotary_inertia).lower()
    return _ROD.format(bow=bow, loads=loads, elements=elements, rotary=rotary, run=run)
