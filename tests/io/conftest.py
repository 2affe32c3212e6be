"""Fixtures: a small complete run, its result file and its response in memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexcam import read_case
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import solve
from flexcam.io import read_result, write_pvd
from flexcam.valvetrain import build_structure

DATA = Path(__file__).parents[1] / "data"


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run: prepared case, response in memory, path of its file and the result read back."""

    ready: Any
    response: Any
    path: Path
    result: Any


def solve_to_file(ready, folder, *, sinks=(), overwrite=False):
    """Run a prepared case into a folder; return the response in memory and the sink."""
    sink = open_result_file(ready, folder, overwrite=overwrite)
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink, *sinks]), sink


@pytest.fixture(scope="session")
def solve_into():
    return solve_to_file


@pytest.fixture(scope="session")
def ready():
    """Return the prepared inline case: 721 steps, 37 saved fields in two blocks."""
    prepared = prepare(read_case(DATA / "inline.toml"))
    return replace(prepared, save=replace(prepared.save, fields_per_block=32))


@pytest.fixture(scope="session")
def stored(ready, tmp_path_factory):
    response, sink = solve_to_file(ready, tmp_path_factory.mktemp("result"))
    return StoredRun(ready, response, sink.path, read_result(sink.path))


VECTORS = {
    "displacement": ("displacement", (0, 1, 2)), "rotation": ("displacement", (3, 4, 5)),
    "velocity": ("velocity", (0, 1, 2)), "angular_velocity": ("velocity", (3, 4, 5)),
    "acceleration": ("acceleration", (0, 1, 2)), "angular_acceleration": ("acceleration", (3, 4, 5)),
}  # fmt: skip
"""Point vectors and their unknowns, repeated here to detect an error in the table of the package."""


@pytest.fixture(scope="session")
def nodal_vectors(stored):
    """Return each point vector in memory, shape (steps, nodes, 3); zero for fixed components."""
    numbers = build_structure(stored.ready.model).dofs.numbers

    def vector(series, components):
        unknowns = getattr(stored.response.fields, series)
        padded = np.column_stack([unknowns, np.zeros(len(unknowns))])  # number -1 selects the last column
        return padded[:, numbers[:, components]]

    return {name: vector(*row) for name, row in VECTORS.items()}


@pytest.fixture(
    scope="session", params=[(1, "pushrod"), (5, "Größe & Maß <1> 'x'")], ids=["every", "every-fifth-odd-name"]
)
def collection(request, stored, tmp_path_factory):
    """Write a ParaView collection, partly with an unusual name; return its files and their stride."""
    every, name = request.param
    folder = tmp_path_factory.mktemp("pvd") / f"{name} folder"
    folder.mkdir()
    files = write_pvd(stored.result, folder / f"{name}.pvd", every=every)
    return files, every
