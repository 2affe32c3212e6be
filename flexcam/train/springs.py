"""Rows of springs: their ends, their stretch, the parts of those that are divided."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.train.model import Spring
from flexcam.train.structure import Structure


def inner_name(spring: str, i: int) -> str:
    """Return the name of a spring's inner unknown, counted from the fixed end."""
    return f"springs.{spring}.{i}"


def spring_ends(structure: Structure, name: str, spring: Spring) -> tuple[FloatArray, FloatArray]:
    """Return the rows of a spring's moving end and of its other end (zeros for ground), shape (n,) each."""
    moving = structure.row(spring.at, spring.direction, f"springs.{name}.at")
    if spring.to is None:
        return moving, np.zeros(structure.dofs.size)
    return moving, structure.row(spring.to, spring.direction, f"springs.{name}.to")


def spring_row(structure: Structure, name: str, spring: Spring) -> FloatArray:
    """Return the row of a spring's stretch: motion at its point less that at its other end, shape (n,)."""
    moving, other = spring_ends(structure, name, spring)
    return moving - other


def spring_parts(structure: Structure, name: str, spring: Spring) -> list[tuple[FloatArray, FloatArray]]:
    """Return the rows of the ends of each part of a spring, from its fixed to its moving end."""
    moving, other = spring_ends(structure, name, spring)
    inner = [structure.dofs.unit(inner_name(name, i)) for i in range(1, spring.elements)]
    return list(pairwise([other, *inner, moving]))
