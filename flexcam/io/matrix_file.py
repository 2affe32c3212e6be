"""Text files of nodal matrices: Matrix Market, Nastran punch, and the coordinate lists of Abaqus and CalculiX."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.io.files import read_source

_LIMIT = 3000  # unknowns: the matrices are dense while they are reduced

Label = tuple[int, int]
"""Node number and component (1 to 6) of a row or column."""


@dataclass(frozen=True, eq=False)
class NodalMatrix:
    """Square matrix over components of nodes."""

    labels: tuple[Label, ...]  #: labels of the rows
    values: FloatArray  #: shape (n, n)

    def ordered(self, labels: list[Label]) -> FloatArray:
        """Return the matrix in another order of its rows; rows that it lacks are zero."""
        index = {label: i for i, label in enumerate(labels)}
        rows = np.array([index[label] for label in self.labels], dtype=np.intp)
        matrix = np.zeros((len(labels), len(labels)))
        matrix[np.ix_(rows, rows)] = self.values
        return matrix


def read_matrix(path: Path, where: str, text: str | None = None, name: str | None = None) -> NodalMatrix:
    """Read a matrix file, or its known text.

    A Matrix Market file has six rows per node, numbered from 1. A Nastran punch file has DMIG cards; the name selects
    one of its matrices. In other files a line has node, component, node, component and value, and lines that begin
    with ``*`` are comments; an entry may be given on only one side of the diagonal.
    """
    content = read_source(path, where, text, "a readable matrix file")
    if re.search(r"^DMIG\b", content, re.MULTILINE):
        return _read_punch(content, where, name)
    if name is not None:
        raise refuse("matrix", repr(name), "no name", "the file is no Nastran punch file and has one matrix")
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
    entries: dict[tuple[Label, Label], float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("*"):
            continue
        try:
            node1, dof1, node2, dof2, value = re.split(r"[,\s]+", line.strip().rstrip(","))
            entries[(int(node1), int(dof1)), (int(node2), int(dof2))] = float(value.replace("D", "E"))
        except ValueError:
            allowed = "node, component, node, component, value, or a Matrix Market file"
            raise refuse(where, f"line {number}: {line.strip()[:60]}", allowed) from None
    return _fill(entries, where)


def _fill(entries: dict[tuple[Label, Label], float], where: str, *, one_sided: bool = True) -> NodalMatrix:
    """Return the matrix of entries; one-sided entries stand for their transposed places, too."""
    labels = sorted({label for pair in entries for label in pair})
    _check_size(len(labels), where)
    if not labels or not all(1 <= dof <= 6 for _, dof in labels):
        raise refuse(where, "components beyond 1 to 6" if labels else "no entry", "entries of components 1 to 6")
    place = {label: i for i, label in enumerate(labels)}
    i, j = np.array([[place[row], place[column]] for row, column in entries]).T
    values, known = np.zeros((2, len(labels), len(labels)))
    values[i, j], known[i, j] = list(entries.values()), 1.0
    if not np.isfinite(values).all():
        raise refuse(where, "an infinite entry", "finite numbers")
    return NodalMatrix(tuple(labels), np.where(known > 0.0, values, values.T) if one_sided else values)


def _read_punch(text: str, where: str, name: str | None) -> NodalMatrix:
    """Read the DMIG cards of a Nastran punch file: a header per matrix, then its columns.

    Fields as in the MSC Nastran Quick Reference Guide, entry DMIG: 8 or 16 columns wide, or separated by commas.
    """
    cards = [card for card in _punch_cards(text) if card[0] == "DMIG"]
    headers = {card[1]: card for card in cards if len(card) > 4 and card[2] == "0"}
    chosen = name or (next(iter(headers)) if len(headers) == 1 else "")
    if chosen not in headers:
        remedy = suggest_name(chosen, headers) if chosen else 'name one: { file = ..., matrix = "KAAX" }'
        raise refuse("matrix", repr(name) if name else "nothing", f"one of {', '.join(headers)}", "", remedy)
    form, kind = headers[chosen][3:5]
    if form not in ("1", "6") or kind not in ("1", "2"):
        given = f"{chosen} of form {form} and type {kind}"
        raise refuse(where, given, "a square or symmetric matrix of real numbers: form 1 or 6, type 1 or 2")
    entries: dict[tuple[Label, Label], float] = {}
    for card in (card for card in cards if card[1] == chosen and card[2] != "0"):
        try:
            column = int(card[2]), int(card[3] or 0) or 1  # scalar points, such as modes, have no component
            for i in range(5, len(card), 4):
                if card[i]:
                    node, dof, value = (*card[i : i + 3], "", "")[:3]
                    entries[(int(node), int(dof or 0) or 1), column] = _punch_number(value)
        except ValueError:
            raise refuse(where, f"DMIG {' '.join(card[1:5])[:60]}", "numbers of nodes, components and values") from None
    return _fill(entries, where, one_sided=form == "6")


def _punch_cards(text: str) -> Iterator[list[str]]:
    """Yield the cards of a punch file as fields; further lines of a card begin with a continuation field."""
    card: list[str] = []
    for line in (line.split("$")[0].rstrip() for line in text.splitlines()):
        if "," in line:
            first, *fields = (part.strip() for part in line.split(","))
            fields = fields[:8]
        else:
            wide = "*" in line[:8]
            count, width = (4, 16) if wide else (8, 8)
            first, fields = line[:8].strip(), [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]
        if not line.strip():
            continue
        if first.strip("*+") and not first.startswith(("*", "+")):
            if card:
                yield card
            card = [first.strip("*")]
        card += fields
    if card:
        yield card


def _punch_number(text: str) -> float:
    """Return a number of Nastran, whose exponent may have a D or no letter: ``1.5D+3`` or ``1.5+3``."""
    return float(re.sub(r"(?<=[\d.])(?=[+-])", "E", text.upper().replace("D", "E")))


def _check_size(count: int, where: str) -> None:
    if count > _LIMIT:
        raise refuse(where, f"{count} unknowns", f"up to {_LIMIT}", "the reduction is dense", "reduce the body before")
