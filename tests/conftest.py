"""Fixtures of all tests: rows of the generated pages, read-only arrays, small models and systems.

`record` compares a computed number with its reference and stores a row. The rows of a session, from all xdist workers,
go to ``build/verification.json`` (or the path in FLEXCAM_VERIFICATION_JSON), the source of the verification manual; so
the manual names only existing tests. Rows of `tests/extremes` go to ``build/extremes.json`` (FLEXCAM_EXTREMES_JSON),
and rows of the fixture `tried`, about bad input and injected faults, to ``build/trust.json`` (FLEXCAM_TRUST_JSON).

``build/flexcam`` caches compiled code by a hash of its source, unless FLEXCAM_CACHE names another folder.
"""

import gc
import json
import math
import os
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent
from flexcam.cli.app import run_state
from flexcam.cli.main import main
from flexcam.core import Triplets
from flexcam.dynamics import Load, LocalForce, Probe, System, engine_selection, jit
from flexcam.dynamics.kernel_step import PROGRAM
from flexcam.fem.assembly import Member
from flexcam.fem.dofs import direction
from flexcam.fem.rigid_bodies import PointMass
from flexcam.fem.sections import Material, Section
from flexcam.io import read_mesh
from flexcam.valvetrain import Cam, MassAt, Model, PublishedLoad, Rocker, Spring
from tests.command import Ended

MESHES = Path(__file__).parents[1] / "meshes"

ROWS = pytest.StashKey[dict[str, list[dict[str, object]]]]()
"""Rows by page."""

ORDER = {
    "verification": ("source", "case", "quantity", "test"),
    "extremes": ("extreme", "test", "place"),
    "trust": ("kind", "what", "test"),
}
"""Pages with the sort keys of their rows."""

ROOT = Path(__file__).parents[1]

COMPILER = engine_selection._COMPILER
"""Default of the estimated time of the direct engine above which flexcam selects the kernel engine."""


@pytest.fixture(scope="session", autouse=True)
def declared_signatures():
    """Code compiled into a wheel reads arguments without a check, and numba compiles a function again for new types."""
    yield
    for name, _ in PROGRAM.entries:
        if isinstance(entry := PROGRAM.compile()[name], jit._Entry):
            assert set(entry._entry.signatures) <= {PROGRAM.argument_types(name)}, name


def pytest_configure(config):
    config.stash[ROWS] = {page: [] for page in ORDER}
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # otherwise every process compiles flexcam
    sys.dont_write_bytecode = False  # otherwise every worker rewrites all assertions
    os.environ.setdefault("FLEXCAM_FILES", str(ROOT))  # meshes for cases in temporary folders
    if os.environ.get("FLEXCAM_PLANTED"):
        _disable_shrinking()
    os.environ.setdefault("FLEXCAM_CACHE", str(ROOT / "build"))  # shared by workers and commands
    engine_selection._COMPILER = 0.0  # the kernel engine also for short runs with contacts


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    for page, rows in json.loads(getattr(node, "workeroutput", {}).get("rows", "{}")).items():
        node.config.stash[ROWS][page].extend(rows)


def _disable_shrinking():
    """Stop hypothesis at the first failing example, which is sufficient for a planted fault."""
    from hypothesis import Phase, settings

    settings.register_profile("planted", phases=(Phase.explicit, Phase.generate))
    settings.load_profile("planted")


def pytest_collection_finish():
    """Exclude long-lived objects from garbage collection."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 1000)


def pytest_sessionfinish(session):
    rows = session.config.stash[ROWS]
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["rows"] = json.dumps(rows)
        return
    for page, page_rows in rows.items():
        if page_rows:
            _write(page, page_rows)


def _write(page, rows):
    path = Path(os.environ.get(f"FLEXCAM_{page.upper()}_JSON", ROOT / "build" / f"{page}.json"))
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = sorted(rows, key=lambda row: tuple(str(row[k]) for k in ORDER[page]))
    path.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _round(value):
    """Return ten significant digits; the others may differ between machines."""
    return float(f"{float(value):.10g}")


@pytest.fixture
def record(request):
    """Assert |computed - reference| <= tolerance |reference| (or tolerance, if absolute) and store a row."""

    def store(*, source, case, quantity, unit, reference, computed, tolerance, reason, absolute=False):
        allowed = tolerance if absolute else tolerance * abs(reference)
        deviation = abs(float(computed) - float(reference))
        passed = bool(deviation <= allowed)  # False for NaN
        row = {
            "source": source, "case": case, "quantity": quantity, "unit": unit, "reference": _round(reference),
            "computed": _round(computed), "tolerance": _round(tolerance), "absolute": absolute, "reason": reason,
            "passed": passed, "test": request.node.nodeid,
        }  # fmt: skip
        request.config.stash[ROWS]["verification"].append(row)
        assert passed, (
            f"{case}, {quantity}: {computed:.10g} {unit}, reference {reference:.10g}, allowed +-{allowed:.3g}"
        )

    return store


@pytest.fixture
def tried(request):
    """Store a row of the robustness page: kind and description of inputs or faults, their number and the outcome.

    Call it after the assertions, so that a row exists only if they pass. `kind` is one of the parts in
    `docs/make_trust.py`.
    """

    def store(kind, what, count, outcome):
        row = {"kind": kind, "what": what, "count": int(count), "outcome": outcome, "test": request.node.nodeid}
        request.config.stash[ROWS]["trust"].append(row)

    return store


@pytest.fixture
def page_rows(request):
    """Return a function that returns the list of the rows of a page."""
    return lambda page: request.config.stash[ROWS][page]


@pytest.fixture(scope="session")
def readonly():
    """Return a function that makes a read-only copy of an array."""

    def make(values):
        array = np.array(values, dtype=float)
        array.setflags(write=False)
        return array

    return make


@pytest.fixture(scope="session")
def steel():
    """Return the steel of the published models."""
    return Material(E=207e9, nu=0.29, density=7800.0)


@pytest.fixture(scope="session")
def published(steel):
    """Return a function that makes model 1, 2 or 3 of Tayeb and Sliman with the data of the documentation."""
    uy = direction("uy")

    def make(model=3, law="shm", event=None, **contact):
        event = event or LiftEvent(LAWS[law], lift=0.006, rise=math.pi, fall=math.pi)
        return Model(
            mesh=read_mesh(MESHES / f"tayeb-{model}.msh"),
            members={
                "camshaft": Member(steel, Section.circle(0.025)), "pushrod": Member(steel, Section.tube(0.008, 0.005)),
            },
            supports={
                "drive": ("uy", "uz", "rx"), "bearings": ("uy", "uz"), "guide": ("ux", "uz", "rx", "ry", "rz"),
                "tappet": ("ux", "uz", "ry"),
            },
            masses={
                "lobe": MassAt("cam", PointMass(0.15)), "follower": MassAt("tappet", PointMass(0.10)),
                "valve": MassAt("valve", PointMass(0.10)),
            },
            springs={"valve": Spring("valve", uy, 40e3)},
            rockers={"rocker": Rocker("pushrod-top", "valve", (0.025, 0.040), 1e-4, uy)},
            cams={"intake": Cam("cam", event)},
            contacts={"intake": PublishedLoad("intake", "tappet", uy, np.array([1.0, 0.0, 0.0]), **contact)},
            probes=("valve", "cam"),
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def system_of():
    """Return a function that makes a System from dense matrices, with a probe on every unknown."""

    def make(M, C, K, loads=(), local=()):
        n = len(M)
        names = tuple(f"x{i}" for i in range(n))
        vectors = tuple(
            Load(f"load{i}", np.asarray(vector, float), history) for i, (vector, history) in enumerate(loads)
        )
        probes = (Probe("all", names, np.eye(n), (None,) * n),)
        parts = [Triplets.from_dense(np.asarray(X, float)) for X in (M, C, K)]
        return System(*parts, names, vectors, tuple(local), probes)

    return make


@pytest.fixture(scope="session")
def local_force():
    """Return a function that makes a local force on one scalar with one law."""
    from flexcam.dynamics import AngleVector, constant

    def make(name, row, law):
        row = np.asarray(row, float)
        return LocalForce(name, (AngleVector.constant(row),), (AngleVector.constant(-row),), law, (constant(0.0),))

    return make


@pytest.fixture(scope="session")
def on_a_screen():
    """Return the first arguments of a command that needs a screen; each process searches from its own display number.

    Without `-noreset`, the server would reset after its last client and be unavailable to the next one.
    """
    return ["xvfb-run", "-a", "-n", str(100 + os.getpid() % 30_000), "-s", "-screen 0 800x600x24 -noreset"]


@pytest.fixture
def shipped_selection(monkeypatch):
    """Use the default engine selection: the direct engine for short runs with contacts."""
    monkeypatch.setattr(engine_selection, "_COMPILER", COMPILER)


@pytest.fixture(scope="session")
def fitted_order():
    """Return a function for the least-squares slope of log(error) over log(step)."""
    return lambda steps, errors: float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.fixture(scope="session")
def pvbatch(on_a_screen):
    """Return the command of ParaView; skip the test if it is not installed."""
    missing = [name for name in ("pvbatch", "xvfb-run") if shutil.which(name) is None]
    if missing and os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
        pytest.fail(f"FLEXCAM_REQUIRE_PARAVIEW=1, but {' and '.join(missing)} cannot be found")
    if missing:
        pytest.skip(f"PARAVIEW WAS NOT TRIED: no {' and '.join(missing)}; apt-get install paraview xvfb xauth")
    return [*on_a_screen, "pvbatch"]


@pytest.fixture
def flexcam(tmp_path, monkeypatch, capsys):
    """Return a function that runs the command in this process, without the time to start Python."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(signal, "signal", lambda *_: None)

    def run(*words):
        monkeypatch.setattr(run_state, "solving", False)
        with pytest.raises(SystemExit) as exit_info:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Ended(exit_info.value.code, out, err)

    return run
