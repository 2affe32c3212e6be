"""Fixtures of all tests: the record of verification, read-only arrays, small models and systems.

`record` asserts a computed number against its reference and keeps the row; all rows of a session, from every xdist
worker, go to ``build/verification.json`` (or the path in FLEXCAM_VERIFICATION_JSON), from which the page of
verification is made. A page can thus name no test that does not exist. The rows of `tests/extremes` go the same way to
``build/extremes.json`` (FLEXCAM_EXTREMES_JSON); those that `tried` keeps, of bad input and injected faults, to
``build/trust.json`` (FLEXCAM_TRUST_JSON).

Machine code is kept in ``build/flexcam``, by a digest of its source text, unless FLEXCAM_CACHE names another folder.
"""

from __future__ import annotations

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
from flexcam.dynamics import Load, LocalForce, Probe, System, engine_selection
from flexcam.fem.assembly import Member
from flexcam.fem.dofs import direction
from flexcam.fem.rigid_bodies import PointMass
from flexcam.fem.sections import Material, Section
from flexcam.io import read_mesh
from flexcam.valvetrain import Cam, MassAt, Model, PublishedLoad, Rocker, Spring
from tests.command import Ended

MESHES = Path(__file__).parents[1] / "meshes"

ROWS = pytest.StashKey[dict[str, list[dict[str, object]]]]()
"""Rows by the page they stand on."""

ORDER = {
    "verification": ("source", "case", "quantity", "test"),
    "extremes": ("extreme", "test", "place"),
    "trust": ("kind", "what", "test"),
}
"""Pages, and what their rows are ordered by."""

ROOT = Path(__file__).parents[1]

COMPILER = engine_selection._COMPILER
"""Time of the direct engine above which a user's run has the kernel engine."""


def pytest_configure(config):
    config.stash[ROWS] = {page: [] for page in ORDER}
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process that is started compiles all of flexcam anew
    sys.dont_write_bytecode = False  # else every worker rewrites the assertions of all tests anew
    os.environ.setdefault("FLEXCAM_FILES", str(ROOT))  # cases in temporary folders name the meshes of the repository
    if os.environ.get("FLEXCAM_PLANTED"):
        _without_shrinking()
    os.environ.setdefault(
        "FLEXCAM_CACHE", str(ROOT / "build")
    )  # workers and commands find it set, and compile nothing twice
    engine_selection._COMPILER = 0.0  # runs with contacts in the kernel engine, however short


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    for page, rows in json.loads(getattr(node, "workeroutput", {}).get("rows", "{}")).items():
        node.config.stash[ROWS][page].extend(rows)


def _without_shrinking():
    """Let hypothesis stop at the first example that fails: under a planted fault it does not matter which."""
    from hypothesis import Phase, settings

    settings.register_profile("planted", phases=(Phase.explicit, Phase.generate))
    settings.load_profile("planted")


def pytest_collection_finish():
    """Take what stays to the end out of what Python's collector walks through again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 1000)


def pytest_sessionfinish(session):
    rows = session.config.stash[ROWS]
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["rows"] = json.dumps(rows)
        return
    for page, its in rows.items():
        if its:
            _write(page, its)


def _write(page, rows):
    path = Path(os.environ.get(f"FLEXCAM_{page.upper()}_JSON", ROOT / "build" / f"{page}.json"))
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = sorted(rows, key=lambda row: tuple(str(row[k]) for k in ORDER[page]))
    path.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _digits(value):
    """Ten significant digits: the last six bits differ between machines and are no news."""
    return float(f"{float(value):.10g}")


@pytest.fixture
def record(request):
    """Assert |computed - reference| <= tolerance |reference| (or tolerance, where absolute) and keep the row."""

    def keep(*, source, case, quantity, unit, reference, computed, tolerance, reason, absolute=False):
        allowed = tolerance if absolute else tolerance * abs(reference)
        deviation = abs(float(computed) - float(reference))
        passed = bool(deviation <= allowed)  # False for NaN
        row = {
            "source": source, "case": case, "quantity": quantity, "unit": unit, "reference": _digits(reference),
            "computed": _digits(computed), "tolerance": _digits(tolerance), "absolute": absolute, "reason": reason,
            "passed": passed, "test": request.node.nodeid,
        }  # fmt: skip
        request.config.stash[ROWS]["verification"].append(row)
        assert passed, (
            f"{case}, {quantity}: {computed:.10g} {unit}, reference {reference:.10g}, allowed +-{allowed:.3g}"
        )

    return keep


@pytest.fixture
def tried(request):
    """Keep a row of the page of trust: what was done to flexcam, how often, and how it ended every time.

    To be called after the assertions, so that only what held is kept. `kind` is one of the parts of
    `docs/make_trust.py`, `count` how many inputs or faults, `outcome` the words of what happened.
    """

    def keep(kind, what, count, outcome):
        row = {"kind": kind, "what": what, "count": int(count), "outcome": outcome, "test": request.node.nodeid}
        request.config.stash[ROWS]["trust"].append(row)

    return keep


@pytest.fixture
def page_rows(request):
    """Return the list that the rows of a page are kept in, by the page's name."""
    return lambda page: request.config.stash[ROWS][page]


@pytest.fixture(scope="session")
def readonly():
    """Return a copy of an array that nobody can write to."""

    def make(values):
        array = np.array(values, dtype=float)
        array.setflags(write=False)
        return array

    return make


@pytest.fixture(scope="session")
def steel():
    """Return the documented steel of the published models."""
    return Material(E=207e9, nu=0.29, density=7800.0)


@pytest.fixture(scope="session")
def published(steel):
    """Return model 1, 2 or 3 of Tayeb and Sliman with flexcam's documented data."""
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
    """Return a System from dense matrices, with a probe on every unknown."""

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
    """Return a local force that senses and acts on one scalar through one law."""
    from flexcam.dynamics import AngleVector, constant

    def make(name, row, law):
        row = np.asarray(row, float)
        return LocalForce(name, (AngleVector.constant(row),), (AngleVector.constant(-row),), law, (constant(0.0),))

    return make


@pytest.fixture(scope="session")
def on_a_screen():
    """Return how a command begins that needs a screen; every process looks for one from a number of its own on.

    A server that resets when its last client leaves is not there for the next one: hence `-noreset`.
    """
    return ["xvfb-run", "-a", "-n", str(100 + os.getpid() % 30_000), "-s", "-screen 0 800x600x24 -noreset"]


@pytest.fixture
def shipped_selection(monkeypatch):
    """Choose engines as a user's run does: the direct engine for short runs with contacts."""
    monkeypatch.setattr(engine_selection, "_COMPILER", COMPILER)


@pytest.fixture(scope="session")
def fitted_order():
    """Return the slope of log(error) over log(step), by least squares."""
    return lambda steps, errors: float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.fixture(scope="session")
def pvbatch(on_a_screen):
    """Return how ParaView is called; where it is not there, its tests are skipped in plain words."""
    lacking = [name for name in ("pvbatch", "xvfb-run") if shutil.which(name) is None]
    if lacking and os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
        pytest.fail(f"FLEXCAM_REQUIRE_PARAVIEW=1, but {' and '.join(lacking)} cannot be found")
    if lacking:
        pytest.skip(f"PARAVIEW WAS NOT TRIED: no {' and '.join(lacking)}; apt-get install paraview xvfb xauth")
    return [*on_a_screen, "pvbatch"]


@pytest.fixture
def flexcam(tmp_path, monkeypatch, capsys):
    """Run the command in this process, which a start of Python would take four times as long as most commands do."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(signal, "signal", lambda *_: None)

    def run(*words):
        monkeypatch.setattr(run_state, "solving", False)
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Ended(ended.value.code, out, err)

    return run
