"""Reduced bases: exact statics and lowest modes."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam import read_case, run
from flexcam.analysis.preparation import prepare
from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import corrected_modes, craig_bampton, modes, solve


def chain(rng, size, *, held=True, light=()):
    """Return mass and stiffness of a chain of masses on springs, the first spring to ground; some masses are zero."""
    M, K = np.diag(rng.uniform(0.5, 2.0, size)), np.zeros((size, size))
    M[list(light), list(light)] = 0.0
    K[0, 0] = rng.uniform(1.0, 9.0) if held else 0.0
    for i in range(size - 1):
        K[i : i + 2, i : i + 2] += rng.uniform(1.0, 9.0) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return Triplets.from_dense(M), Triplets.from_dense(K)


def static_solution(K, T, f):
    """Return the displacement under a load in a reduced basis."""
    return T @ np.linalg.lstsq(T.T @ K @ T, T.T @ f, rcond=1e-13)[0]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 14), st.integers(1, 20), st.integers(1, 3), st.booleans())
def test_corrected_modes_have_exact_statics(seed, size, count, pushed, light):
    rng = np.random.default_rng(seed)
    mass, stiffness = chain(rng, size, light=(size // 2,) if light else ())
    places = rng.normal(size=(pushed, size))
    T = corrected_modes(mass, stiffness, places, count)
    assert T.shape[1] <= min(size, count + pushed)
    K = stiffness.dense()
    for f in places:
        np.testing.assert_allclose(
            static_solution(K, T, f), np.linalg.solve(K, f), atol=1e-7 * np.abs(np.linalg.solve(K, f)).max()
        )
    for matrix in (mass, stiffness):
        small = T.T @ matrix.dense() @ T
        np.testing.assert_allclose(small - np.diag(small.diagonal()), 0.0, atol=1e-7 * np.abs(small).max())
    kept = modes(mass, stiffness, count).omegas
    np.testing.assert_allclose(T[:, : len(kept)].T @ K @ T[:, : len(kept)], np.diag(kept**2), atol=1e-9 * kept[-1] ** 2)


def test_free_motions_extend_basis():
    rng = np.random.default_rng(0)
    mass, stiffness = chain(rng, 8, held=False)
    push = np.eye(8)[:1]
    for free in (None, np.ones((8, 1))):
        T = corrected_modes(mass, stiffness, push, 2, free=free)
        assert T.shape == (8, 4)
        np.testing.assert_allclose(stiffness.dense() @ T[:, 0], 0.0, atol=1e-12)
    # The response to a balanced load is exact, except for the free motion.
    f = np.eye(8)[0] - mass.dense().diagonal() / mass.dense().trace()
    exact = np.linalg.lstsq(stiffness.dense(), f, rcond=None)[0]
    missed = static_solution(stiffness.dense(), T, f) - exact
    np.testing.assert_allclose(missed - missed.mean(), 0.0, atol=1e-10)


@pytest.mark.parametrize("count", [1, 2, 30])
def test_craig_bampton_statics_and_frequencies(count):
    """Statics of loads on the boundary are exact, frequencies are upper bounds, and all modes give the full model."""
    rng = np.random.default_rng(1)
    mass, stiffness = chain(rng, 12)
    boundary, groups = np.array([4, 8]), [np.arange(4), np.arange(5, 8), np.arange(9, 12)]
    T = craig_bampton(mass, stiffness, boundary, groups, count)
    np.testing.assert_array_equal(T[boundary], np.eye(2, T.shape[1]))
    K = stiffness.dense()
    for i in boundary:
        np.testing.assert_allclose(static_solution(K, T, np.eye(12)[i]), np.linalg.solve(K, np.eye(12)[i]), rtol=1e-9)
    small = [Triplets.from_dense(T.T @ one.dense() @ T) for one in (mass, stiffness)]
    few, full = modes(*small, 3).omegas, modes(mass, stiffness, 3).omegas
    assert (few >= full * (1.0 - 1e-12)).all()
    if count == 30:
        assert T.shape == (12, 12)
        np.testing.assert_allclose(few, full, rtol=1e-10)


@pytest.mark.parametrize(
    ("boundary", "groups", "message"),
    [
        ([0], [[1, 2]], "every unknown once"),
        ([0], [[1, 2], [2, 3]], "every unknown once"),
        ([0], [[1, 2, 3]], "holds every group"),
    ],
)
def test_invalid_craig_bampton_groups_raise_error(boundary, groups, message):
    K = np.diag([1.0, 1.0, 0.0, 0.0]) + np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1.0, -1.0], [0, 0, -1.0, 1.0]])
    with pytest.raises(InputError) as refusal:
        craig_bampton(
            Triplets.from_dense(np.eye(4)), Triplets.from_dense(K), np.array(boundary), [np.array(g) for g in groups], 1
        )
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    ("case", "limits"),
    [
        ("tayeb/model-3-shm", (1e-4, 1e-9)),
        pytest.param("direct-acting/bucket", (5e-3, 1e-8), marks=pytest.mark.slow),
    ],
)
def test_modal_reduction_converges_to_full_model(case, limits, cases_folder):
    short = ["run.revolutions=0.5", "run.steps_per_revolution=1800", "run.engine=kernel"]
    whole, few, all_of_them = (
        run_case(cases_folder / f"{case}.toml", [*short, *more])
        for more in ([], ["fidelity.modes=5"], ["fidelity.modes=90"])
    )
    assert few.stats.unknowns < all_of_them.stats.unknowns <= whole.stats.unknowns
    assert few.outline == whole.outline
    for found, limit in zip((few, all_of_them), limits, strict=True):
        missed = np.abs(found.probes.displacement - whole.probes.displacement).max()
        assert missed <= limit * np.abs(whole.probes.displacement).max()


def test_all_modes_of_train_with_massless_unknown_match_full_model(cases_folder):
    """A lever's tip has no mass: the basis includes the highest modes, which rounding loses otherwise.

    Contact forces agree up to the rounding of open contacts; three modes less leave an error of 5e-5.
    """
    short = ["run.revolutions=0.35", "run.steps_per_revolution=1200", "run.engine=kernel"]
    path = cases_folder / "pushrod-engine" / "lever.toml"
    whole, modal = (run_case(path, [*short, *more]) for more in ([], ["fidelity.modes=1000"]))
    assert modal.stats.unknowns == whole.stats.unknowns
    for name in ("contacts.intake.force", "contacts.lash.force", "members.pushrod.compression"):
        np.testing.assert_allclose(
            modal.channels[name], whole.channels[name], rtol=0.0, atol=1e-9 * whole.channels[name].max()
        )


def test_high_modes_with_massless_unknown():
    """Ten masses with frequencies over nine decades, and one massless node between two springs: all ten modes."""
    stiff = 100.0 ** np.arange(10)
    K = np.zeros((11, 11))
    K[:10, :10] = np.diag(stiff)
    K[[4, 4, 10, 10], [4, 10, 4, 10]] += stiff[4] * np.array(
        [1.0, -1.0, -1.0, 2.0]
    )  # equal springs to mass 5 and to ground: half the stiffness in series
    found = modes(Triplets.from_dense(np.diag([*np.ones(10), 0.0])), Triplets.from_dense(K))
    assert (found.lost, found.shapes.shape) == (0, (11, 10))
    exact = stiff.copy()
    exact[4] *= 1.5
    np.testing.assert_allclose(found.omegas**2, exact, rtol=1e-12)
    np.testing.assert_allclose(found.shapes[10], 0.5 * found.shapes[4], atol=1e-12 * np.abs(found.shapes).max())


def run_case(path, more):
    ready = prepare(read_case(path, more))
    response = solve(ready.problem, ready.scheme, save=ready.save)
    assert response.status.ok
    return response


@pytest.fixture(scope="session")
def cases_folder(request):
    return request.config.rootpath / "cases"


@pytest.mark.parametrize("case", ["tayeb/model-3-shm", pytest.param("pushrod-engine/intake", marks=pytest.mark.slow)])
def test_craig_bampton_of_case(case):
    """Components between loaded and observed points: all modes equal the beam model, few modes are close."""
    path = Path(__file__).parents[2] / "cases" / f"{case}.toml"
    about = ["run.steps_per_revolution=360", "run.revolutions=0.4", "run.engine=kernel"]
    beams = run(read_case(path, about))
    moved = beams.probes.displacement
    for count, allowed in ((50, 1e-9), (3, 1e-3)):  # rounding, and the error of three modes per component
        found = run(read_case(path, [*about, f"fidelity.modes={count}", 'fidelity.reduction="craig-bampton"']))
        assert found.status.ok
        assert np.abs(found.probes.displacement - moved).max() <= allowed * np.abs(moved).max()
        assert (found.stats.unknowns < beams.stats.unknowns) == (count == 3)
