"""C1 by the Runge-Kutta method of MuJoCo: slide joints, and all forces as a passive force compiled by numba.

MuJoCo's own contacts have a different force law. A hinge that rotates at constant speed provides the time in a step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import mujoco
import numba
import numpy as np
from numba import types

from benchmarks.peers.train import FloatArray, Setting, Train, equations

STEPS = (900, 1800, 3600, 7200, 14400)
_MODEL = """<mujoco>
<option integrator="RK4" gravity="0 0 0" timestep="{step:.17g}"><flag contact="disable" constraint="disable"/></option>
<worldbody>
<body><joint type="hinge" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
{masses}
</worldbody></mujoco>"""
_MASS = """<body><joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/></body>"""


def settings(train: Train) -> Iterator[Setting]:
    """Yield the Runge-Kutta method with its numbers of steps."""
    for steps in STEPS:
        yield Setting("MuJoCo, RK4", f"{steps} steps", partial(_prepare, train, steps))


def _prepare(train: Train, steps: int) -> Callable[[], FloatArray]:
    masses = "\n".join(_MASS.format(mass=mass) for mass in train.masses)
    model = mujoco.MjModel.from_xml_string(_MODEL.format(step=train.period / steps, masses=masses))
    data = mujoco.MjData(model)
    force = _passive_force(train, data)
    start, speed, every, count = train.start, train.speed, steps // train.instants, train.instants

    def run() -> FloatArray:
        mujoco.set_mjcb_passive(force.ctypes)
        mujoco.mj_resetData(model, data)
        data.qpos[1:], data.qvel[0], data.qvel[1:] = start[:3], speed, start[3:]
        motion, position, velocity = np.empty((count + 1, 6)), data.qpos, data.qvel
        motion[0] = start
        for i in range(1, count + 1):
            mujoco.mj_step(model, data, every)
            motion[i, :3], motion[i, 3:] = position[1:], velocity[1:]
        mujoco.set_mjcb_passive(None)
        return motion

    return run


def _passive_force(train: Train, data: mujoco.MjData) -> Any:
    """Return the forces on the joints as a function in C that reads and writes the arrays of `data`."""
    laws, speed = equations(train, wrap=numba.njit), train.speed
    forces = laws.forces
    positions, velocities, passive = (array.ctypes.data for array in (data.qpos, data.qvel, data.qfrc_passive))

    @numba.extending.intrinsic
    def pointer(_: object, address: types.Integer) -> object:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> object:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(types.float64)(address), generate

    @numba.cfunc(types.void(types.voidptr, types.voidptr))
    def passive_force(model: object, data: object) -> None:
        q, v = numba.carray(pointer(positions), 4), numba.carray(pointer(velocities), 4)
        f = numba.carray(pointer(passive), 4)
        f[1], f[2], f[3] = forces(q[0] / speed, q[1], q[2], q[3], v[1], v[2], v[3])

    return passive_force
