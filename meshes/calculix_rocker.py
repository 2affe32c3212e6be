"""Make the superelement of `flexcam new solid-rocker`: ``python meshes/calculix_rocker.py`` (needs CalculiX, ``ccx``).

The rocker consists of hexahedra with 20 nodes. Rigid bodies of CalculiX join the bore and both ends to reference
nodes, whose six unknowns are the interface. CalculiX stores the matrices of the complete model
(``SOLVER=MATRIXSTORAGE``). The script reduces them to the interface and the lowest fixed-interface modes (Craig and
Bampton) and writes both as Matrix Market files. It prints the frequencies of the complete model with two kinds of
supports. Units: mm, t, s.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import eigsh, splu

FOLDER = Path(__file__).resolve().parents[1] / "flexcam/templates"
STATIONS = np.linspace(-30.0, 45.0, 16)
ACROSS = 3
MODES = 24
ENDS = {"pad": (1, False), "pivot": (6, True), "tip": (14, False)}
"""Interfaces: station, and whether all nodes around it belong to the interface, or only those of the lower face."""

CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip

Place = tuple[int, int, int]
SUPPORTS = {"clamped": {"pivot": (1, 2, 3, 4, 5, 6)}, "hinged": {"pivot": (1, 2, 3, 4, 5), "tip": (2,)}}
"""Supported components of the reference nodes in the runs of the complete model."""


def position(place: Place) -> tuple[float, float, float]:
    """Return the position of a grid node, mm; the bar is thicker and wider at its bore."""
    x = float(np.interp(0.5 * place[0], np.arange(len(STATIONS)), STATIONS))
    height, width = 4.5 + 5.5 * np.exp(-((x / 14.0) ** 2)), 5.0 + 4.0 * np.exp(-((x / 12.0) ** 2))
    return x, 0.0015 * x * x + height * (place[1] / ACROSS - 1.0), width * (place[2] / ACROSS - 1.0)


def mesh_text() -> tuple[str, dict[str, tuple[int, int]]]:
    """Return the input text of the model, and reference and rotation node of each interface."""
    grid = product(range(2 * len(STATIONS) - 1), range(2 * ACROSS + 1), range(2 * ACROSS + 1))
    places = [place for place in grid if sum(i % 2 for i in place) < 2]
    number = {place: i + 1 for i, place in enumerate(places)}
    lines = ["*NODE", *(f"{number[place]}, " + ", ".join(f"{x:.9g}" for x in position(place)) for place in places)]
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=BODY")
    cells = product(range(0, 2 * len(STATIONS) - 2, 2), range(0, 2 * ACROSS, 2), range(0, 2 * ACROSS, 2))
    for e, (i, j, k) in enumerate(cells):
        nodes = [str(number[i + a, j + b, k + c]) for a, b, c in CORNERS + EDGES]
        lines += [f"{e + 1}, " + ", ".join(nodes[:10]) + ",", ", ".join(nodes[10:])]
    references: dict[str, tuple[int, int]] = {}
    for name, (station, thick) in ENDS.items():
        nodes = [p for p in places if abs(p[0] - 2 * station) <= 1 + thick and (thick or p[1] == 0)]
        centre = np.mean([position(place) for place in nodes], axis=0).round(6) + 0.0
        first = len(places) + 1 + 2 * len(references)
        references[name] = first, first + 1
        lines += ["*NODE", *(f"{node}, " + ", ".join(f"{x:.9g}" for x in centre) for node in references[name])]
        lines += [f"*NSET, NSET={name.upper()}", *(f"{number[place]}," for place in nodes)]
        lines.append(f"*RIGID BODY, NSET={name.upper()}, REF NODE={first}, ROT NODE={first + 1}")
        sys.stdout.write(f"{name} at {centre.tolist()} mm\n")
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "207000., 0.29", "*DENSITY", "7.8E-9"]
    return "\n".join([*lines, "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", ""]), references


def calculate(folder: Path, name: str, text: str) -> None:
    """Run CalculiX."""
    (folder / f"{name}.inp").write_text(text, encoding="utf-8")
    subprocess.run(["ccx", name], cwd=folder, check=True, capture_output=True)  # noqa: S603, S607


def read_symmetric(path: Path) -> csc_array:
    """Return a symmetric matrix from the triangle that CalculiX stores."""
    rows, cols, values = np.loadtxt(path, unpack=True)
    i, j = rows.astype(int) - 1, cols.astype(int) - 1
    half = coo_array((np.where(i == j, 0.5, 1.0) * values, (i, j))).tocsc()
    return csc_array(half + half.T)


def main() -> None:
    """Write the reduced matrices and print the frequencies of the complete model."""
    mesh, references = mesh_text()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        calculate(folder, "all", f"{mesh}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
        stiffness, mass = (read_symmetric(folder / f"all.{kind}") for kind in ("sti", "mas"))
        labels = {line: i for i, line in enumerate((folder / "all.dof").read_text().split())}
        for case, supports in SUPPORTS.items():
            lines = [
                f"{references[n][(c - 1) // 3]}, {(c - 1) % 3 + 1}" for n, parts in supports.items() for c in parts
            ]
            text = "\n".join([mesh + "*BOUNDARY", *lines, "*STEP", "*FREQUENCY", "8", "*END STEP", ""])
            calculate(folder, case, text)
            rows = [line.split() for line in (folder / f"{case}.dat").read_text().splitlines()]
            frequencies = [row[3] for row in rows if len(row) == 5 and row[0].isdigit()][:8]
            sys.stdout.write(f"{case}: {', '.join(frequencies)} Hz\n")
    interface = [labels[f"{node}.{c}"] for nodes in references.values() for node in nodes for c in (1, 2, 3)]
    interior = np.setdiff1d(np.arange(len(labels)), interface)
    interior_stiffness, coupling = stiffness[interior][:, interior].tocsc(), stiffness[interior][:, interface].toarray()
    modes = eigsh(interior_stiffness, MODES, mass[interior][:, interior], sigma=0.0)[1]
    shapes = np.zeros((len(labels), len(interface) + MODES))
    shapes[interface, np.arange(len(interface))] = 1.0
    shapes[interior] = np.column_stack([-splu(interior_stiffness).solve(coupling), modes / np.abs(modes).max(axis=0)])
    FOLDER.mkdir(exist_ok=True)
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        reduced = shapes.T @ (matrix @ shapes)
        comment = "rocker of CalculiX 2.20, mm-t-s: pad, pivot, tip, then modes; made by meshes/calculix_rocker.py"
        mmwrite(FOLDER / f"rocker-{name}.mtx", 0.5 * (reduced + reduced.T), comment, symmetry="symmetric", precision=12)
    sys.stdout.write(f"{len(labels)} unknowns, {len(interface) + MODES} after reduction\n")


if __name__ == "__main__":
    main()
