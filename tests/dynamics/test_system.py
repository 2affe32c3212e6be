"""Cam motion, angle vectors and load tables of a system."""

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import CamMotion, ConstantSpeed, Load, Problem, System, modes


def test_constant_speed():
    motion = ConstantSpeed(3.0, start=0.5).at(np.array([0.0, 2.0]))
    np.testing.assert_array_equal([motion.angle, motion.speed, motion.rate], [[0.5, 6.5], [3.0, 3.0], [0.0, 0.0]])
    with pytest.raises(InputError):
        ConstantSpeed(0.0)


def test_load_tables():
    loads = tuple(Load(str(k), np.full(2, k), lambda motion, k=k: k * motion.speed) for k in (1.0, 2.0))
    system = System(*(Triplets.zeros(2) for _ in range(3)), ("a", "b"), loads)
    motion = CamMotion(np.zeros(4), np.arange(4.0), np.zeros(4), np.zeros(4))
    assert system.load_histories(motion).shape == (4, 2)
    np.testing.assert_array_equal(
        system.load_histories(motion) @ system.load_vectors(), np.outer(5 * np.arange(4.0), [1, 1])
    )


def test_system_without_loads():
    system = System(*(Triplets.zeros(3) for _ in range(3)), ("a", "b", "c"))
    assert (system.load_histories(ConstantSpeed(1.0).at(np.zeros(5))) @ system.load_vectors()).shape == (5, 3)


def test_constant_history_of_load():
    load = Load("push", np.ones(2), lambda motion: 3.0)
    system = System(*(Triplets.zeros(2) for _ in range(3)), ("a", "b"), (load,))
    np.testing.assert_array_equal(system.load_vector(ConstantSpeed(1.0).at(np.zeros(4))), np.full((4, 2), 3.0))


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"names": ("a",)}, "names"),
        ({"damping": Triplets.zeros(3)}, "damping"),
        ({"stiffness": Triplets.zeros(1)}, "stiffness"),
        ({"loads": (Load("push", np.ones(3), lambda motion: motion.angle),)}, "load push"),
    ],
)
def test_parts_of_other_sizes_are_refused(change, where):
    none = Triplets.zeros(2)
    with pytest.raises(InputError, match=f"{where}: got size .*the size of the mass matrix, 2"):
        System(**{"mass": none, "damping": none, "stiffness": none, "names": ("a", "b")} | change)


def test_fraction_of_steps_is_refused():
    system = System(*(Triplets.zeros(1) for _ in range(3)), ("a",))
    with pytest.raises(InputError, match=r"steps: got 10\.5"):
        Problem(system, ConstantSpeed(1.0), step=1e-3, steps=10.5)


def test_asymmetric_matrices_have_no_modes():
    symmetric, other = (Triplets.from_dense([[2.0, -1.0], [end, 2.0]]) for end in (-1.0, -0.5))
    with pytest.raises(InputError, match="stiffness"):
        modes(symmetric, other)
    with pytest.raises(InputError, match="mass"):
        modes(other, symmetric)
