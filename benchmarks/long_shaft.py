"""A shaft on a hundred elastic bearings, as a case."""

from __future__ import annotations

E, NU, DENSITY = 207e9, 0.29, 7800.0
SPAN, SPANS = 0.5, 99
"""Distance of the bearings, m, and number of spans."""


def case_text(elements: int) -> str:
    """Return the text of the case with a number of elements per span."""
    names = [f"b{i}" for i in range(SPANS + 1)]
    nodes = "\n".join(f"{name} = [{SPAN * i}, 0, 0]" for i, name in enumerate(names))
    bearings = "\n".join(f'{name} = {{ at = "{name}", stiffness = "100 kN/mm" }}' for name in names)
    return f"""format = 1
title = "Shaft on a hundred bearings"
[nodes]
{nodes}
[materials.steel]
E = {E}
nu = {NU}
density = {DENSITY}
[sections]
round = {{ shape = "circle", diameter = "25 mm" }}
[members]
shaft = {{ nodes = {names}, elements = {elements}, material = "steel", section = "round" }}
[supports]
b0 = ["ux", "rx"]
[bearings]
{bearings}
[loads]
push = {{ at = "b1", direction = "uy", force = "100 N" }}
[run]
speed = "1500 rpm"
revolutions = 0.01
[output]
probes = ["b50"]
"""
