"""Reactions of supports against statics, section forces and the balance of a shaft."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case, solve
from flexcam.dynamics import SaveAt
from flexcam.fem.recovery import section_forces
from flexcam.valvetrain import build_structure, build_system

SOURCE = "Reactions of supports"
ROOT = Path(__file__).parents[2]
SHAFT = """
format = 1
nodes = { left = [0, 0, 0], middle = [0.3, 0, 0], right = [0.8, 0, 0] }
materials.steel = { E = 2e11, nu = 0.3, density = 7800 }
sections.round = { shape = "circle", diameter = "20 mm" }
members.shaft = { nodes = ["left", "middle", "right"], elements = 4, material = "steel", section = "round" }
loads.push = { at = "middle", direction = "uy", force = "500 N" }
run = { speed = "3000 rpm", revolutions = 0.2, steps_per_revolution = 720, gravity = [0, -9.81, 0] }
"""
PINNED = 'supports={ left = ["ux", "uy", "uz", "rx"], right = ["uy", "uz"] }'
CLAMPED = 'supports={ left = ["ux", "uy", "uz", "rx", "ry", "rz"] }'
DAMPED = "run.damping={ alpha = 8.0, beta = 1e-6 }"
CAMSHAFT = ("drive", "front", "rear")
JOURNAL = (  # a journal beside its node, whose rotation is held
    'nodes.journal=["100 mm", 0, 0]', 'rigid_links.stub={ from = "rear", to = ["journal"] }',
    'bearings.rear.at="journal"', "run.revolutions=0.01", 'run.start="equilibrium"',
)  # fmt: skip


@pytest.fixture
def shaft(tmp_path):
    """Return a function that runs the shaft with some overrides, with all fields saved."""
    path = tmp_path / "shaft.toml"
    path.write_text(SHAFT, encoding="utf-8")

    def run(*overrides):
        ready = prepare(read_case(path, overrides))
        return ready, solve(ready.problem, ready.scheme, save=SaveAt(field_every=1))

    return run


def test_shaft_on_two_supports(record, shaft):
    _, response = shaft(PINNED, 'output.reactions=["left", "right"]', 'run.start="equilibrium"')
    weight = 7800.0 * math.pi * 0.01**2 * 0.8 * 9.81
    for name, share in (("left", 0.625), ("right", 0.375)):
        force = response.channels[f"supports.{name}.force_y"]
        record(source=SOURCE, case="pinned shaft with weight and a load", quantity=f"force of the support {name}",
               unit="N", reference=0.5 * weight - share * 500.0, computed=force[-1], tolerance=1e-9,
               reason="statics")  # fmt: skip
        np.testing.assert_allclose(response.channels[f"supports.{name}.force"], abs(force), rtol=1e-9)


def test_clamp_matches_section_forces(record, shaft):
    """The section forces contain inertia and damping, as the equations of motion do."""
    ready, response = shaft(CLAMPED, DAMPED, 'output.reactions=["left"]')
    structure, fields = build_structure(ready.model), response.fields
    u, v, a = (structure.dofs.nodal(values) for values in fields)
    ends = section_forces(structure.beams, u, velocity=v, acceleration=a, damping=ready.model.damping)[:, 0, 0]
    reference = -(ends + weight_of_first_element(structure)) @ np.kron(np.eye(2), structure.beams.triads[0])
    for i, name in ((1, "force_y"), (5, "moment_z")):
        found = response.channels[f"supports.left.{name}"]
        record(source=SOURCE, case="clamped shaft after a step of the load", quantity=f"largest error of {name}",
               unit="1", reference=0.0, computed=np.abs(found - reference[:, i]).max() / np.abs(found).max(),
               tolerance=1e-9, absolute=True, reason="the same equations")  # fmt: skip


def weight_of_first_element(structure):
    """Return the end forces that the weight of the first element exerts at its first end, local axes, shape (6,)."""
    length, force = structure.beams.length[0], -7800.0 * math.pi * 0.01**2 * 9.81
    world = np.array([0.0, 0.5 * force * length, 0.0, 0.0, 0.0, force * length**2 / 12.0])
    triad = structure.beams.triads[0]
    return np.concatenate([triad @ world[:3], triad @ world[3:]])


@pytest.mark.parametrize("name", ["cases/pushrod-engine/intake.toml", "tests/data/inline.toml"])
def test_supports_of_slow_camshaft_balance_the_cam_force(record, name):
    """In slow motion the bearings carry the force of the cam, by a unilateral contact or a published load."""
    slow = ("run={ speed='6 rpm', revolutions=0.5, steps_per_revolution=720, start='equilibrium' }",
            f"output.reactions={[*CAMSHAFT]}")  # fmt: skip
    ready = prepare(read_case(ROOT / name, slow))
    response = solve(ready.problem, ready.scheme)
    total = sum(response.channels[f"supports.{support}.force_y"] for support in CAMSHAFT)
    force = response.channels["contacts.intake.force"]
    record(source=SOURCE, case=f"slow camshaft of {Path(name).stem}", quantity="largest error of the sum of reactions",
           unit="1", reference=0.0, computed=np.abs(total - force).max() / force.max(), tolerance=1e-3, absolute=True,
           reason="inertia of the shaft")  # fmt: skip


def test_film_at_a_link_of_a_supported_node(record):
    """The moment of the support is that of a stiff spring in its place."""

    def start(*overrides):
        ready = prepare(read_case(ROOT / "flexcam/templates/gear-drive.toml", [*JOURNAL, *overrides]))
        return ready, solve(ready.problem, ready.scheme, save=SaveAt(field_every=1))

    _, held = start('supports.rear=["ry", "rz"]', 'output.reactions=["rear"]')
    spring = 'springs.stiff={ at = "rear", direction = "rz", stiffness = 1e9 }'
    ready, sprung = start('supports.rear=["ry"]', spring)
    turn = build_structure(ready.model).dofs.nodal(sprung.fields.displacement)[0, ready.model.mesh.node("rear"), 5]
    record(source=SOURCE, case="oil film beside a support, by a spring of 1e9 N m/rad in its place",
           quantity="moment about z", unit="N m", reference=-1e9 * turn, tolerance=1e-3, reason="yield of the spring",
           computed=held.channels["supports.rear.moment_z"][0])  # fmt: skip


def test_supports_at_one_node_are_one_reaction():
    model = build_model(read_case(ROOT / "tests/data/inline.toml"))
    points = dict(model.mesh.points, twin=model.mesh.points["front"])
    model = replace(model, mesh=replace(model.mesh, points=points), reactions=("front", "twin"),
                    supports={**model.supports, "front": ("uy",), "twin": ("uz",)})  # fmt: skip
    names = [channel.name for channel in build_system(model, 100.0).channels if "front" in channel.name]
    assert names == ["supports.front.force", "supports.front.force_y", "supports.front.force_z"]


def test_reactions_leave_the_motion_unchanged():
    case = read_case(ROOT / "tests/data/inline.toml", ["run.revolutions=0.1"])
    asked = read_case(case.path, ["run.revolutions=0.1", 'output.reactions=["front"]'])
    assert build_model(asked).reactions == ("front",)
    one, other = (solve(ready.problem, ready.scheme) for ready in map(prepare, (case, asked)))
    np.testing.assert_array_equal(one.fields.displacement, other.fields.displacement)
    added = set(other.channels) - set(one.channels)
    assert added == {f"supports.front.{end}" for end in ("force", "force_y", "force_z")}
