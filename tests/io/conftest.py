"""A small finished run, its result file and what stood in memory."""

from __future__ import annotations

from dataclasses import dataclass
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
class Done:
    """A run: what it was made from, its response in memory, its file and the file read back."""

    ready: Any
    response: Any
    path: Path
    result: Any


def solved(ready, folder, *, sinks=(), overwrite=False):
    """Run a prepared case into a folder; return the response in memory and the sink."""
    sink = open_result_file(ready, folder, overwrite=overwrite)
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink, *sinks]), sink


@pytest.fixture(scope="session")
def solve_into():
    return solved


@pytest.fixture(scope="session")
def ready():
    """Get the inline case ready to run: 721 instants, 37 saved fields in two blocks."""
    return prepare(read_case(DATA / "inline.toml"))


@pytest.fixture(scope="session")
def done(ready, tmp_path_factory):
    response, sink = solved(ready, tmp_path_factory.mktemp("result"))
    return Done(ready, response, sink.path, read_result(sink.path))


VECTORS = {
    "displacement": ("displacement", (0, 1, 2)), "rotation": ("displacement", (3, 4, 5)),
    "velocity": ("velocity", (0, 1, 2)), "angular_velocity": ("velocity", (3, 4, 5)),
    "acceleration": ("acceleration", (0, 1, 2)), "angular_acceleration": ("acceleration", (3, 4, 5)),
}  # fmt: skip
"""Point vectors and the unknowns they come from: written down here again, so that a wrong table is seen."""


@pytest.fixture(scope="session")
def nodal(done):
    """Return each point vector as it stood in memory, shape (instants, nodes, 3); zero where a support holds."""
    numbers = build_structure(done.ready.model).dofs.numbers

    def vector(series, components):
        unknowns = getattr(done.response.fields, series)
        held = np.column_stack([unknowns, np.zeros(len(unknowns))])  # number -1 is the last column
        return held[:, numbers[:, components]]

    return {name: vector(*row) for name, row in VECTORS.items()}


@pytest.fixture(
    scope="session", params=[(1, "pushrod"), (5, "Größe & Maß <1> 'x'")], ids=["every", "every-fifth-odd-name"]
)
def collection(request, done, tmp_path_factory):
    """Write a ParaView collection into a folder with an awkward name; return its files and their stride."""
    every, name = request.param
    folder = tmp_path_factory.mktemp("pvd") / f"{name} folder"
    folder.mkdir()
    files = write_pvd(done.result, folder / f"{name}.pvd", every=every)
    return files, every
