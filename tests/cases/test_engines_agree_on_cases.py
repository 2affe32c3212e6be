"""Every case that is shipped goes every way through time alike: motion, channels, energies, internal states, events."""

from __future__ import annotations

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
"""Parts of the largest: rounding of one whose axial entries are 1e4 times those of bending, and that a velocity has
by 1/step, an acceleration by 1/step^2. A general run with its unknowns in another order is as far away."""

CONTACTS = {"displacement": 1e-9, "velocity": 1e-6, "acceleration": 1e-4}
"""With contacts: a force is settled to 1e-12 of the largest, and every touchdown makes more of it."""


def shorter(path, *overrides):
    ready = prepare(read_case(path, [*SHORT, *overrides]))
    return replace(ready.problem, steps=min(ready.problem.steps, 720)), ready.scheme


def forced(problem, scheme, path):
    """Return the run a way."""
    return solve(replace(problem, engine=path), scheme, save=SaveAt(field_every=20))


def unfit(problem, path):
    """Return what the refusal says where the way is not the problem's; nothing where it is."""
    if not integrated_size(problem):
        return "0 unknowns"
    return "depends on the motion" if path == "modal" and problem.system.local_forces else ""


def assert_one_of(problem, scheme, found, most):
    """Assert that a run is a general one; where contacts part at a touchdown, one of those that rounding may make.

    Loads larger by what a force is settled to send a general run one way or the other, by 1e-5 of the motion; a run in
    machine code goes exactly one of these ways.
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
"""Cases whose direct runs take long; the small models of `tests/golden` have their parts in the normal suite."""


def named(path):
    marks = pytest.mark.slow if path.stem in SLOW else ()
    return pytest.param(path, id=f"{path.parent.name}-{path.stem}", marks=marks)


@pytest.mark.parametrize("path", ["modal", "kernel"])
@pytest.mark.parametrize("case", mostly_slow([named(path) for path in CASES], 2))
def test_every_case(case, path):
    problem, scheme = shorter(case)
    if why := unfit(problem, path):
        with pytest.raises(InputError, match=why):
            forced(problem, scheme, path)
        return
    found = forced(problem, scheme, path)
    assert found.stats.engine == path
    assert found.status.ok
    assert_one_of(problem, scheme, found, CONTACTS if problem.system.local_forces else LINEAR)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rpm", "steps"), [
    ("pushrod-engine/intake", 2000, 720), ("pushrod-engine/intake", 100, 360), ("pushrod-engine/lever", 6500, 360),
    ("direct-acting/bucket", 8000, 120), ("direct-acting/finger", 100, 120),
])  # fmt: skip
def test_steps_that_hardly_settle(name, rpm, steps):
    """Where a contact goes to and fro within Newton's iteration, both ways find the one balance there is.

    Steps as coarse as that are not resolved: 1e-3 is far above what impacts make of rounding, and far below the
    tenths by which a step differs that one way takes whole and the other in halves.
    """
    coarse = [f'run.crank_speed="{rpm} rpm"', "run.revolutions=1", f"run.steps_per_revolution={steps}"]
    ready = prepare(read_case(ROOT / f"cases/{name}.toml", coarse))
    runs = [solve(replace(ready.problem, engine=path), ready.scheme) for path in ("direct", "kernel")]
    one, other = (run.probes.displacement for run in runs)
    assert [run.status.ok for run in runs] == [True, True]
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-3 * np.abs(one).max())


@pytest.mark.parametrize(("name", "method"), [
    pytest.param("direct-acting/bucket.toml", "hht", marks=pytest.mark.slow),
    ("direct-acting/finger.toml", "generalized-alpha"),
    pytest.param("pushrod-engine/intake.toml", "generalized-alpha", marks=pytest.mark.slow),
    ("tayeb/model-3-shm.toml", "hht"), ("tayeb/model-3-shm.toml", "generalized-alpha"),
])  # fmt: skip
def test_schemes_that_weigh_the_old_instant(name, method):
    ready = prepare(read_case(ROOT / "cases" / name, [*SHORT, f'run.integrator={{ method = "{method}" }}']))
    problem = replace(ready.problem, steps=720)
    found = forced(problem, ready.scheme, "kernel")
    assert_one_of(problem, ready.scheme, found, CONTACTS)


@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_the_rigid_companion_of_a_forced_way(path):
    """What is asked of the flexible train's run is not asked of the rigid one beside it, which has no unknowns."""
    case = read_case(ROOT / "cases/tayeb/model-1-shm.toml", [*SHORT, f'run.engine="{path}"'])
    assert prepare(case).problem.engine == path
    companion = prepare(case, rigid=True)
    assert solve(companion.problem, companion.scheme).status.ok


@pytest.mark.parametrize("prune", [False, True])
@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_pruned_and_whole(path, prune):
    """What cannot move is left out of the natural motions too; nothing that is shown changes."""
    problem, scheme = shorter(ROOT / "cases/tayeb/model-3-shm.toml")
    problem = replace(problem, prune=prune)
    found = forced(problem, scheme, path)
    assert found.stats.unknowns == integrated_size(problem)
    assert_one_of(problem, scheme, found, LINEAR)


@pytest.mark.parametrize("change", [
    "fidelity.modes=8", 'fidelity.model="chain"', "run.fluctuation={ orders = [2], amplitudes = [0.05] }",
    pytest.param('run.start="periodic"', marks=pytest.mark.slow),
], ids=lambda change: change.split("=")[0])  # fmt: skip
@pytest.mark.parametrize(
    "name", [pytest.param("direct-acting/bucket.toml", marks=pytest.mark.slow), "tayeb/model-3-shm.toml"]
)
def test_what_else_a_case_may_ask(name, change):
    """Few modes, a chain, a periodic start, a speed that swings."""
    ready = prepare(read_case(ROOT / "cases" / name, [*SHORT, change]))
    problem = replace(ready.problem, steps=720)
    found = forced(problem, ready.scheme, "kernel")
    assert_one_of(problem, ready.scheme, found, CONTACTS)


def test_a_published_load_that_follows_the_camshaft():
    """It senses the shaft's deflection and acts on shaft and tappet: a local force, linear, that stores no energy."""
    problem, scheme = shorter(ROOT / "cases/tayeb/model-3-shm.toml", "contacts.intake.cam_deflection=true")
    assert problem.system.local_forces
    found = forced(problem, scheme, "kernel")
    assert found.stats.engine == "kernel"
    assert_one_of(problem, scheme, found, CONTACTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["direct-acting/bucket.toml", "pushrod-engine/intake.toml"])
def test_going_on_in_machine_code_from_a_general_run(name):
    """A state with contacts and internal states: half a run the general way, the other half compiled."""
    problem, scheme = shorter(ROOT / "cases" / name)
    save = SaveAt(field_every=20)
    whole = solve(replace(problem, engine="direct"), scheme, save=save)
    first = solve(replace(problem, engine="direct", steps=360), scheme, save=save)
    d, v, a = (getattr(first.fields, kind)[-1] for kind in KINDS)
    inner = first.inner if len(first.inner) else None
    start = State(d, v, float(first.time[-1]), inner, acceleration=a)
    later = solve(replace(problem, engine="kernel", steps=360, start=start), scheme, save=save)
    for kind in KINDS:
        one, other = getattr(whole.fields, kind)[18:], getattr(later.fields, kind)
        np.testing.assert_allclose(other, one, rtol=0.0, atol=CONTACTS[kind] * np.abs(one).max(), err_msg=kind)
