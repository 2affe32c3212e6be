"""Solids as lofts: rings of points, skinned with triangles. Every solid of a scene is made so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexcam.linalg import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface of triangles that look outwards.

    Parameters
    ----------
    kind
        What it is a part of, such as ``"lobe"``: parts of a kind look alike.
    points
        m, global axes, shape (n, 3).
    faces
        Point numbers of the triangles, counterclockwise seen from outside, shape (t, 3).
    values
        What it is coloured by, per point, shape (n,); None where nothing is known there.
    """

    kind: str
    points: FloatArray
    faces: IntArray
    values: FloatArray | None = None

    @property
    def volume(self) -> float:
        """Enclosed volume, m^3, by the divergence theorem; negative where the triangles look inwards."""
        a, b, c = np.moveaxis(self.points[self.faces], 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0

    @property
    def closed(self) -> bool:
        """Whether every edge belongs to two triangles that run along it in opposite senses."""
        edges = np.concatenate([self.faces[:, [i, (i + 1) % 3]] for i in range(3)]).tolist()
        seen = {(a, b) for a, b in edges}
        return len(seen) == len(edges) and all((b, a) in seen for a, b in seen)


def loft(kind: str, rings: FloatArray, *, cyclic: bool = False, values: FloatArray | None = None) -> Solid:
    """Return the solid that rings of points span."""
    count, around = rings.shape[:2]
    points = rings.reshape(-1, 3)
    spread = None if values is None else np.repeat(values, around)
    if not cyclic:
        points = np.concatenate([points, rings[[0, -1]].mean(axis=1)])
        spread = None if values is None or spread is None else np.append(spread, values[[0, -1]])
    return Solid(kind, points, _skin(count, around, cyclic), spread)


@lru_cache(maxsize=256)
def _skin(count: int, around: int, cyclic: bool) -> IntArray:
    """Return the triangles between rings, and those of the ends."""
    here = np.arange(count if cyclic else count - 1)[:, None] * around
    there = (here + around) % (count * around)
    i, j = np.arange(around), (np.arange(around) + 1) % around
    sides = [[here + i, here + j, there + j], [here + i, there + j, there + i]]
    faces = [np.stack(side, axis=-1).reshape(-1, 3) for side in sides]
    if not cyclic:
        last, middle = (count - 1) * around, np.full(around, count * around)
        faces += [np.column_stack([middle, j, i]), np.column_stack([middle + 1, last + i, last + j])]
    skin = np.concatenate(faces)
    skin.setflags(write=False)
    return skin


def merged(solids: Sequence[Solid]) -> Solid:
    """Return several solids as one surface."""
    starts = np.cumsum([0, *(len(one.points) for one in solids)])[:-1].tolist()
    values = [one.values for one in solids if one.values is not None]
    return Solid(
        solids[0].kind,
        np.concatenate([one.points for one in solids]),
        np.concatenate([one.faces + start for one, start in zip(solids, starts, strict=True)]),
        np.concatenate(values) if len(values) == len(solids) else None,
    )
