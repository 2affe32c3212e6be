"""The same train with lengths, masses or times a million times larger or smaller has the same dimensionless motion.

Each number of the model is scaled by its dimension, kg^a m^b s^c. A case text with such numbers is refused: no
mechanism has them, and a wrong unit is the likely cause.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from flexcam import build_model, read_case
from flexcam.dynamics import ConstantSpeed, Problem, equilibrium, newmark, solve
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Section
from flexcam.valvetrain import build_structure, build_system, model_modes
from tests.thinning import mostly_slow

UNITS = "scale of the units"
MASS, LENGTH, TIME = (1, 0, 0), (0, 1, 0), (0, 0, 1)
FORCE, STIFF, STRESS, DENSITY = (1, 1, -2), (1, 0, -2), (1, -1, -2), (1, -3, 0)
SPEED, STEPS, TURNS = 157.0, 720, 0.6
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.06, 0.0, 0.0]
rear = [0.12, 0.0, 0.0]
tappet = [0.06, 0.024, 0.0]
top = [0.06, 0.274, 0.0]
[materials.steel]
E = {E}
nu = 0.29
density = {density}
[sections]
shaft = {{ shape = "circle", diameter = 0.03 }}
tube = {{ shape = "tube", outer_diameter = 0.008, inner_diameter = 0.005 }}
[members]
camshaft = {{ nodes = ["drive", "cam", "rear"], material = "steel", section = "shaft" }}
pushrod = {{ nodes = ["tappet", "top"], elements = 2, material = "steel", section = "tube" }}
[supports]
drive = ["ux", "uy", "uz", "rx"]
rear = ["uy", "uz"]
tappet = ["ux", "uz", "ry", "rx"]
top = ["ux", "uz"]
[masses]
follower = {{ at = "tappet", mass = 0.06 }}
valve = {{ at = "top", mass = 0.2 }}
[springs]
valve = {{ at = "top", direction = "uy", stiffness = 1e5, installed_force = 900.0 }}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = 0.006
rise = "90 deg"
return = "90 deg"
phase = "10 deg"
base_radius = 0.024
width = 0.012
follower = {{ type = "flat" }}
[contacts]
intake = {{ cam = "intake", follower = "tappet", {contact} }}
[run]
speed = {speed}
[output]
probes = ["tappet", "top"]
"""
CONTACTS = {
    "bilateral": 'model = "bilateral", stiffness = 5e7', "unilateral": 'model = "unilateral", stiffness = 5e7',
    "Hertz": 'model = "unilateral", stiffness = "hertz"', "published load": 'model = "published-load"',
}  # fmt: skip
SCALES = {"lengths": LENGTH, "masses": MASS, "times": TIME}


class Units:
    """Scale factors of numbers by their dimension, for units larger or smaller by a factor."""

    def __init__(self, factor=1.0, dimension=(0, 0, 0)):
        self._scale = [factor**power for power in dimension]

    def __call__(self, dimension):
        return math.prod(one**power for one, power in zip(self._scale, dimension, strict=True))


def scale_model(model, units):
    """Return a model with all numbers in other units."""
    long, stiff, heavy = units(LENGTH), units(STIFF), units(MASS)
    sections = {"camshaft": Section.circle(0.03 * long), "pushrod": Section.tube(0.008 * long, 0.005 * long)}
    steel = model.members["camshaft"].material
    steel = replace(steel, E=steel.E * units(STRESS), density=steel.density * units(DENSITY))
    spring, cam, contact = model.springs["valve"], model.cams["intake"], model.contacts["intake"]
    follower = replace(cam.follower, base_radius=cam.follower.base_radius * long)
    event = replace(cam.event, lift=cam.event.lift * long)
    if getattr(contact, "stiffness", None) is not None:
        contact = replace(contact, stiffness=contact.stiffness * stiff)
    return replace(
        model,
        mesh=Mesh(model.mesh.nodes * long, model.mesh.lines, model.mesh.points),
        members={n: replace(m, material=steel, section=sections[n]) for n, m in model.members.items()},
        masses={n: replace(m, body=replace(m.body, mass=m.body.mass * heavy)) for n, m in model.masses.items()},
        springs={"valve": replace(spring, stiffness=spring.stiffness * stiff,
                                  installed_force=spring.installed_force * units(FORCE))},
        cams={"intake": replace(cam, event=event, follower=follower, width=cam.width * long)},
        contacts={"intake": contact},
    )  # fmt: skip


@pytest.fixture
def train(tmp_path):
    """Return a function that makes the model with a contact in other units."""

    def make(contact, units):
        path = tmp_path / "train.toml"
        path.write_text(CASE.format(contact=CONTACTS[contact], E=207e9, density=7800.0, speed=SPEED), encoding="utf-8")
        return scale_model(build_model(read_case(path)), units)

    return make


def solve_in_plain_units(model, units):
    """Return displacement and contact force in the units of the unscaled model."""
    speed = SPEED / units(TIME)
    system, drive = build_system(model, speed), ConstantSpeed(speed)
    step = 2.0 * math.pi / speed / STEPS
    response = solve(Problem(system, drive, step, round(TURNS * STEPS), equilibrium(system, drive)), newmark())
    assert response.status.ok, str(response.status)
    return response["top"].displacement[:, 1] / units(LENGTH), response.channels["contacts.intake.force"] / units(FORCE)


PLAIN = {}
"""Displacement and contact force of the unscaled model, by contact."""

FACTORS = pytest.mark.parametrize("factor", [1e6, 1e-6], ids=["larger", "smaller"])


@FACTORS
@pytest.mark.parametrize("what", SCALES)
@pytest.mark.parametrize("contact", mostly_slow(CONTACTS))
def test_scaled_units_give_same_motion(expect, train, contact, what, factor):
    units = Units(factor, SCALES[what])
    if contact not in PLAIN:
        PLAIN[contact] = solve_in_plain_units(train(contact, Units()), Units())
    (top, force), (scaled_top, scaled_force) = PLAIN[contact], solve_in_plain_units(train(contact, units), units)
    # Powers of ten round all numbers of the model: eps times the ratio of maximum to minimum stiffness, 1e6, which also
    # shifts the opening of contacts.
    expect.right(UNITS, f"train, {contact}, {what} times {factor:g}", what="valve's motion off by", reference=0.0,
                 computed=float(np.abs(scaled_top - top).max() / np.abs(top).max()), tolerance=1e-9,
                 absolute=True)  # fmt: skip
    assert np.abs(scaled_force - force).max() <= 1e-6 * np.abs(force).max()  # a contact is a thousand times as stiff


@FACTORS
@pytest.mark.parametrize("what", SCALES)
def test_scaled_units_give_same_frequencies(expect, train, what, factor):
    units = Units(factor, SCALES[what])
    plain, other = (model_modes(build_structure(train("Hertz", u))).modes for u in (Units(), units))
    assert (plain.rigid, plain.lost) == (other.rigid, other.lost)
    ratio = other.omegas[plain.rigid :] * units(TIME) / plain.omegas[plain.rigid :]
    # Rounding of K, at most eps (w_max/w_min)^2 = 1e-9.
    expect.right(UNITS, f"train, {what} times {factor:g}", what="frequencies off by", reference=0.0,
                 computed=float(np.abs(ratio - 1.0).max()), tolerance=1e-8, absolute=True)  # fmt: skip


@pytest.mark.parametrize(("key", "value"), [("E", 207e15), ("density", 7800e6), ("speed", 157e6)])
def test_case_in_wrong_units_is_refused(expect, command, tmp_path, key, value):
    numbers = {"E": 207e9, "density": 7800.0, "speed": SPEED, key: value}
    (tmp_path / "case.toml").write_text(CASE.format(contact=CONTACTS["Hertz"], **numbers), encoding="utf-8")
    code, output = command("check", "case.toml")
    assert code == 2
    expect.refuses(UNITS, f"case with {key} = {value:g} in SI; exit code 2", output, key, "Check the unit")
