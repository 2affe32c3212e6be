"""The page of the result file lists exactly the datasets of results, with units and dimensions."""

import re
from fnmatch import fnmatchcase
from pathlib import Path

import h5py
import pytest

import flexcam
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import Stats

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/result-format.md").read_text(encoding="utf-8")
CASES = (
    "tayeb/model-1-shm", "direct-acting/bucket", "direct-acting/finger", "checks/cantilever", "checks/pump-up",
)  # fmt: skip
"""Cases that together have all channels."""

OIL = "viscosity=0.01,pressure_viscosity=15e-9,roughness=3e-7,conductivity=46,specific_heat=470,wear_coefficient=1e-18"
GUIDE = 'friction.guide={ at = "valve", direction = "uy", force = "8 N" }'
FILM = 'film = { diameter = "26 mm", length = "15 mm", radial_clearance = "30 um", viscosity = "10 mPa s" }'
DRIVE = 'springs.chain={ at = "rear", direction = "rx", stiffness = "5 kN m/rad" }'
MORE = {
    "checks/cantilever": ['output.reactions=["root"]'],
    "direct-acting/bucket": [f"contacts.intake.lubrication={{{OIL}}}"],
    "direct-acting/finger": [GUIDE, DRIVE, f'bearings.front={{ at = "front", {FILM} }}'],
}
"""Overrides of the cases."""


def rows():
    """Return name, dimensions (None for text and variable shapes) and unit of all documented datasets."""
    for line in re.findall(r"^\| (`.*) \|$", PAGE, re.M):
        names, shape, unit, _ = (cell.strip() for cell in re.split(r" \|(?= |$)", line + " |")[:4])
        for name in re.findall(r"`([^`]+)`", names):
            yield name, None if shape in ("", "text") else len(shape.split(",")), unit


DOCUMENTED = {name: (re.sub(r"NAME", "*", name), dimensions, unit) for name, dimensions, unit in rows()}


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """Return dimensions and unit of the datasets of results, by name."""
    folder, sets = tmp_path_factory.mktemp("results"), {}
    for name in CASES:
        case = flexcam.read_case(ROOT / f"cases/{name}.toml", ["run.revolutions=0.01", *MORE.get(name, ())])
        ready = prepare(case)
        sink = open_result_file(ready, folder)
        flexcam.solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
        with h5py.File(sink.path) as file:
            assert set(file["status"].attrs) == set(Stats.__dataclass_fields__)
            file.visititems(lambda name, one: sets.update(dataset_entry(name, one)))
    return sets


def dataset_entry(name, one):
    if not isinstance(one, h5py.Dataset):
        return {}
    unit = one.attrs.get("units", b"")
    return {name: (None if one.dtype.kind in "OS" else one.ndim, unit.decode() if isinstance(unit, bytes) else unit)}


def test_all_datasets_are_documented(datasets):
    for name, (dimensions, unit) in datasets.items():
        documented = [row for row in DOCUMENTED.values() if fnmatchcase(name, row[0])]
        assert documented, name
        assert any(d in (None, dimensions) and (u == unit or is_scalar_unit(unit, u)) for _, d, u in documented), name


def is_scalar_unit(unit, documented):
    """Return whether a unit is that of a probe of one scalar, which has no rotations."""
    return documented.startswith(f"{unit}; rotations")


def test_documented_datasets_exist(datasets):
    assert not [
        name for name, (pattern, _, _) in DOCUMENTED.items() if not any(fnmatchcase(one, pattern) for one in datasets)
    ]


def test_run_statistics_are_documented():
    assert not [name for name in Stats.__dataclass_fields__ if f"`{name}`" not in PAGE]
