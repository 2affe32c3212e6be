"""All engines agree on all shipped cases: motion, channels, energies, internal states and events."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.core.errors import InputError
from flexcam.dynamics import SaveAt, State, integrated_size, solve
from tests.rounding import stronger
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
CASES = [
    path
    for path in sorted((ROOT / "cases").glob("*/*.toml"))
    if path.parent.name != "cams" and not path.stem.endswith(("-cycloidal", "-parabolic"))
]
SHORT = ["run.revolutions=1", "run.steps_per_revolution=720", "run.integrator.method=newmark"]
KINDS = ("displacement", "velocity", "acceleration")

LINEAR = {"displacement": 1e-11, "velocity": 1e-9, "acceleration": 1e-7}
"""Tolerances relative to the maximum: rounding with axial entries 1e4 times those of bending, times 1/step for
velocities and 1/step^2 for accelerations. A direct run with reordered unknowns differs as much.
"""

CONTACTS = {"displacement": 1e-9, "velocity": 1e-6, "acceleration": 1e-4}
"""Tolerances with contacts: a force is iterated to 1e-12 of the maximum, and each impact amplifies the error."""


def short_problem(path, *overrides):
    ready = prepare(read_case(path, [*SHORT, *overrides]))
    return replace(ready.problem, steps=min(ready.problem.steps, 720)), ready.scheme


def solve_with_engine(problem, scheme, path):
    """Return the run by an engine."""
    return solve(replace(problem, engine=path), scheme, save=SaveAt(field_every=20))


def refusal_reason(problem, path):
    """Return the message if the engine cannot solve the problem, otherwise an empty string."""
    if not integrated_size(problem):
        return "0 unknowns"
    return "depends on the motion" if path == "modal" and problem.system.local_forces else ""


def assert_near_direct(problem, scheme, found, most):
    """Assert that a run equals a direct one, or one with loads changed by rounding where an impact is sensitive.

    A change of the loads by the tolerance of the contact forces changes the motion of a direct run by up to 1e-5; a run
    of the kernel equals one of these runs.
    """
    for share in (0.0, 1e-12, -1e-12, 3e-12, -3e-12):
        general = solve(stronger(replace(problem, engine="direct"), share), scheme, save=SaveAt(field_every=20))
        with suppress(AssertionError):
            assert found.stats.events == pytest.approx(general.stats.events, abs=2)
            assert_near(general, found, most)
            return
    assert_near(general, found, most)


def units_of(run, name):
    return dict(run.outline.channels)[name]


def assert_near(general, found, most, tail=""):
    for kind in KINDS:
        for group in ("probes", "fields"):
            one, other = (getattr(getattr(run, group), kind) for run in (general, found))
            size = np.abs(getattr(general.fields, kind)).max(initial=0.0)
            np.testing.assert_allclose(other, one, rtol=0.0, atol=most[kind] * size, err_msg=f"{group} {kind}{tail}")
    for name, values in general.channels.items():
        unit = units_of(general, name)
        alike = [key for key in general.channels if units_of(general, key) == unit]
        size = max(np.abs(general.channels[key]).max() for key in alike)
        rate = "velocity" if "/s" in unit or unit == "W" else "displacement"
        allowed = 100.0 * most["velocity" if unit in ("N", "N m", "Pa", "J") else rate]
        np.testing.assert_allclose(found.channels[name], values, rtol=0.0, atol=allowed * size, err_msg=f"{name}{tail}")


SLOW = ("bucket", "camshaft", "finger", "intake", "leak-down", "lever", "pump-up", "rocker", "valve-mass")
"""Cases whose direct runs take long; the small models of `tests/golden` test their parts in the normal suite."""


def case_param(path):
    marks = pytest.mark.slow if path.stem in SLOW else ()
    return pytest.param(path, id=f"{path.parent.name}-{path.stem}", marks=marks)


@pytest.mark.parametrize("path", ["modal", "kernel"])
@pytest.mark.parametrize("case", mostly_slow([case_param(path) for path in CASES], 2))
def test_engine_agrees_with_direct_engine(case, path):
    problem, scheme = short_problem(case)
    if why := refusal_reason(problem, path):
        with pytest.raises(InputError, match=why):
            solve_with_engine(problem, scheme, path)
        return
    found = solve_with_engine(problem, scheme, path)
    assert found.stats.engine == path
    assert found.status.ok
    assert_near_direct(problem, scheme, found, CONTACTS if problem.system.local_forces else LINEAR)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rpm", "steps"), [
    ("pushrod-engine/intake", 2000, 720), ("pushrod-engine/intake", 100, 360), ("pushrod-engine/lever", 6500, 360),
    ("direct-acting/bucket", 8000, 120), ("direct-acting/finger", 100, 120),
])  # fmt: skip
def test_engines_agree_with_coarse_steps(name, rpm, steps):
    """Both engines find the same equilibrium where a contact alternates in the Newton iteration.

    Such coarse steps do not resolve the motion: 1e-3 is far above the rounding amplified by impacts, and far below the
    difference of some tenths between a full step and two half steps.
    """
    coarse = [f'run.crank_speed="{rpm} rpm"', "run.revolutions=1", f"run.steps_per_revolution={steps}"]
    ready = prepare(read_case(ROOT / f"cases/{name}.toml", coarse))
    runs = [solve(replace(ready.problem, engine=path), ready.scheme) for path in ("direct", "kernel")]
    one, other = (run.probes.displacement for run in runs)
    assert [run.status.ok for run in runs] == [True, True]
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-3 * np.abs(one).max())


@pytest.mark.parametrize(("name", "method"), [
    pytest.param("direct-acting/bucket.toml", "hht", marks=pytest.mark.slow),
    pytest.param("direct-acting/finger.toml", "generalized-alpha", marks=pytest.mark.slow),
    pytest.param("pushrod-engine/intake.toml", "generalized-alpha", marks=pytest.mark.slow),
    ("tayeb/model-3-shm.toml", "hht"), ("tayeb/model-3-shm.toml", "generalized-alpha"),
])  # fmt: skip
def test_kernel_agrees_with_direct_for_weighted_schemes(name, method):
    ready = prepare(read_case(ROOT / "cases" / name, [*SHORT, f'run.integrator={{ method = "{method}" }}']))
    problem = replace(ready.problem, steps=720)
    found = solve_with_engine(problem, ready.scheme, "kernel")
    assert_near_direct(problem, ready.scheme, found, CONTACTS)


@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_rigid_model_ignores_selected_engine(path):
    """The engine is selected for the flexible model; the rigid model has no unknowns."""
    case = read_case(ROOT / "cases/tayeb/model-1-shm.toml", [*SHORT, f'run.engine="{path}"'])
    assert prepare(case).problem.engine == path
    companion = prepare(case, rigid=True)
    assert solve(companion.problem, companion.scheme).status.ok


@pytest.mark.parametrize("prune", [False, True])
@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_engines_agree_with_and_without_pruning(path, prune):
    """Pruning removes inactive unknowns from the modes too; no output changes."""
    problem, scheme = short_problem(ROOT / "cases/tayeb/model-3-shm.toml")
    problem = replace(problem, prune=prune)
    found = solve_with_engine(problem, scheme, path)
    assert found.stats.unknowns == integrated_size(problem)
    assert_near_direct(problem, scheme, found, LINEAR)


@pytest.mark.parametrize("change", [
    "fidelity.modes=8", 'fidelity.model="chain"', "run.fluctuation={ orders = [2], amplitudes = [0.05] }",
    pytest.param('run.start="periodic"', marks=pytest.mark.slow),
], ids=lambda change: change.split("=")[0])  # fmt: skip
@pytest.mark.parametrize(
    "name", [pytest.param("direct-acting/bucket.toml", marks=pytest.mark.slow), "tayeb/model-3-shm.toml"]
)
def test_kernel_agrees_with_direct_for_run_options(name, change):
    """Few modes, a chain, a periodic start, a speed fluctuation."""
    ready = prepare(read_case(ROOT / "cases" / name, [*SHORT, change]))
    problem = replace(ready.problem, steps=720)
    found = solve_with_engine(problem, ready.scheme, "kernel")
    assert_near_direct(problem, ready.scheme, found, CONTACTS)


def test_kernel_agrees_with_direct_for_cam_deflection():
    """The load depends on the shaft's deflection and acts on shaft and tappet: a linear local force without energy."""
    problem, scheme = short_problem(ROOT / "cases/tayeb/model-3-shm.toml", "contacts.intake.cam_deflection=true")
    assert problem.system.local_forces
    found = solve_with_engine(problem, scheme, "kernel")
    assert found.stats.engine == "kernel"
    assert_near_direct(problem, scheme, found, CONTACTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["direct-acting/bucket.toml", "pushrod-engine/intake.toml"])
def test_kernel_continues_direct_run(name):
    """The state at half the run contains contacts and internal states."""
    problem, scheme = short_problem(ROOT / "cases" / name)
    save = SaveAt(field_every=20)
    full = solve(replace(problem, engine="direct"), scheme, save=save)
    first = solve(replace(problem, engine="direct", steps=360), scheme, save=save)
    d, v, a = (getattr(first.fields, kind)[-1] for kind in KINDS)
    inner = first.inner if len(first.inner) else None
    start = State(d, v, float(first.time[-1]), inner, acceleration=a)
    later = solve(replace(problem, engine="kernel", steps=360, start=start), scheme, save=save)
    for kind in KINDS:
        one, other = getattr(full.fields, kind)[18:], getattr(later.fields, kind)
        np.testing.assert_allclose(other, one, rtol=0.0, atol=CONTACTS[kind] * np.abs(one).max(), err_msg=kind)
