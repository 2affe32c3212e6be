"""What is loaded when: ``import flexcam`` nothing heavy, a small run neither scipy nor meshio."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

HEAVY = {
    "scipy",
    "numba",
    "pyvista",
    "vtkmodules",
    "matplotlib",
    "plotly",
    "dask",
    "meshio",
    "h5py",
    "pydantic",
    "cyclopts",
    "rich",
    "pint",
}
CASE = Path(__file__).parents[1] / "data/inline.toml"
ROOT = Path(__file__).parents[2]


def loaded(code):
    """Return the packages that a fresh process has loaded after some code."""
    tail = "\nimport sys\nsys.stdout.write(' '.join({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code + tail], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_the_import_loads_nothing_heavy():
    assert not loaded("import flexcam") & HEAVY


@pytest.mark.parametrize(
    "code",
    ["flexcam.newmark()", "flexcam.Material(E=1.0, nu=0.3, density=1.0)", "flexcam.ConstantSpeed(1.0)",
     "flexcam.Mesh([[0, 0, 0], [1, 0, 0]], {'a': [0, 1]}, {})", "flexcam.LAWS['shm']"],
)  # fmt: skip
def test_parts_load_only_numpy(code):
    assert not loaded(f"import flexcam\n{code}") & HEAVY


def test_a_small_run_needs_neither_scipy_nor_meshio():
    code = f"import flexcam\nassert flexcam.run(flexcam.read_case({str(CASE)!r})).status.ok"
    assert not loaded(code) & (HEAVY - {"h5py", "pydantic"})


def test_a_mesh_file_loads_no_more_than_meshio():
    code = f"import flexcam\nflexcam.prepare(flexcam.read_case({str(ROOT / 'cases/tayeb/model-1-shm.toml')!r}))"
    assert loaded(code) & HEAVY <= {"h5py", "pydantic", "meshio", "rich"}, "rich comes with meshio"


def test_the_command_line_draws_nothing():
    command = f"cli.main(['check', {str(CASE)!r}, '--json'])"
    code = f"from flexcam import cli\ntry:\n    {command}\nexcept SystemExit:\n    pass"
    assert not loaded(code) & {"scipy", "numba", "pyvista", "vtkmodules", "matplotlib", "plotly", "dask", "meshio"}


def fastest(code, times=3):
    found = []
    for _ in range(times):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
        found.append(time.perf_counter() - begin)
    return min(found)


def test_the_import_is_light():
    """Nothing but Python's own modules: a tenth of what numpy alone costs; 0.1 s leaves room for a busy machine."""
    assert fastest("import flexcam") - fastest("pass") < 0.1
