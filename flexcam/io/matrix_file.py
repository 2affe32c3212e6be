"""Text files of nodal matrices: Matrix Market, and the coordinate lists of Abaqus and CalculiX."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.io.files import read_source

_MOST = 3000  # unknowns: the matrices are dense while they are reduced


@dataclass(frozen=True, eq=False)
class NodalMatrix:
    """Square matrix over components of nodes."""

    labels: tuple[tuple[int, int], ...]  #: node number and component (1 to 6) of every row
    values: FloatArray  #: shape (n, n)

    def ordered(self, labels: list[tuple[int, int]]) -> FloatArray:
        """Return the matrix in another order of its rows; rows that it lacks are zero."""
        place = {label: i for i, label in enumerate(labels)}
        at = np.array([place[label] for label in self.labels], dtype=np.intp)
        found = np.zeros((len(labels), len(labels)))
        found[np.ix_(at, at)] = self.values
        return found


def read_matrix(path: Path, where: str, text: str | None = None) -> NodalMatrix:
    """Read a matrix file, or its known text.

    A Matrix Market file has six rows per node, numbered from 1. In other files a line has node, component, node,
    component and value, and lines that begin with ``*`` are comments; an entry may be given on one side of the
    diagonal only.
    """
    content = read_source(path, where, text, "a readable matrix file")
    return _read_market(content, where) if content.startswith("%%MatrixMarket") else _read_list(content, where)


def _read_market(text: str, where: str) -> NodalMatrix:
    from scipy.io import mminfo, mmread

    try:
        rows, cols = mminfo(io.BytesIO(text.encode()))[:2]
        _check_size(max(rows, cols), where)
        matrix = mmread(io.BytesIO(text.encode()))
    except (ValueError, TypeError) as fault:
        raise refuse(where, "a damaged Matrix Market file", "a file that scipy.io.mmread reads", str(fault)) from None
    values = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    if np.iscomplexobj(values):
        raise refuse(where, "complex numbers", "a matrix of real numbers", "structural damping is not modelled")
    values = np.asarray(values, dtype=float)
    if rows != cols or not np.isfinite(values).all():
        raise refuse(where, f"{rows} rows and {cols} columns", "a square matrix of finite numbers")
    if rows % 6:
        raise refuse(where, f"{rows} rows", "six rows per node")
    return NodalMatrix(tuple((i // 6 + 1, i % 6 + 1) for i in range(rows)), values)


def _read_list(text: str, where: str) -> NodalMatrix:
    ends: list[tuple[tuple[int, int], tuple[int, int]]] = []
    entries: list[float] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("*"):
            continue
        try:
            node, dof, other, across, value = re.split(r"[,\s]+", line.strip().rstrip(","))
            entries.append(float(value.replace("D", "E")))
            ends.append(((int(node), int(dof)), (int(other), int(across))))
        except ValueError:
            allowed = "node, component, node, component, value, or a Matrix Market file"
            raise refuse(where, f"line {number}: {line.strip()[:60]}", allowed) from None
    labels = sorted({label for pair in ends for label in pair})
    _check_size(len(labels), where)
    if not labels or not all(1 <= dof <= 6 for _, dof in labels):
        raise refuse(where, "components beyond 1 to 6" if labels else "no entry", "entries of components 1 to 6")
    place = {label: i for i, label in enumerate(labels)}
    i, j = (np.array([place[pair[side]] for pair in ends]) for side in (0, 1))
    values, known = np.zeros((2, len(labels), len(labels)))
    values[i, j], known[i, j] = entries, 1.0
    if not np.isfinite(values).all():
        raise refuse(where, "an infinite entry", "finite numbers")
    return NodalMatrix(tuple(labels), np.where(known > 0.0, values, values.T))


def _check_size(count: int, where: str) -> None:
    if count > _MOST:
        raise refuse(where, f"{count} unknowns", f"up to {_MOST}", "the reduction is dense", "reduce the body before")
