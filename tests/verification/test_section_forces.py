"""Section forces against statics and stresses against textbooks.

Sources: statics of the part beyond the cut; S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., sec. 109
(torsion of rectangles); J. E. Shigley, Mechanical Engineering Design, 9th ed., eq. 6-46 (Goodman).
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexcam import prepare, read_case
from flexcam.analysis.run import output_geometry
from flexcam.dynamics import (
    Block,
    ConstantSpeed,
    Problem,
    SaveAt,
    Series,
    equilibrium,
    newmark,
    solve,
    static_displacement,
)
from flexcam.fem.assembly import (
    Damping,
    Member,
    assemble_loads,
    build_beams,
    distributed_load,
    element_weight,
    stiffness,
)
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import Mesh, chain
from flexcam.fem.recovery import fibres, section_forces
from flexcam.fem.rigid_bodies import PointMass
from flexcam.fem.sections import Material, Section
from flexcam.io.vtk import constant_data
from flexcam.report.tables import strength_table
from flexcam.valvetrain import GivenLoad, MassAt, Model, StrengthSink, build_structure, build_system

FORCES = ("N", "Vy", "Vz", "T", "My", "Mz")
STATICS = "Statics of the part beyond a cut"
UNEQUAL = Section(A=4e-4, Iy=2e-8, Iz=7e-9, J=1e-8)
LENGTH = 0.8
AXES = {"along z": np.array([0.0, 0.0, 1.0]), "skew": np.array([2.0, -1.0, 2.0]) / 3.0}
COMPRESSED_ROD = """
format = 1
nodes = { foot = [0, 0, 0], middle = [0, 0.025, 0], top = [0, 0.05, 0] }
materials.steel = { E = 2e11, nu = 0.3, density = 7800, ultimate_strength = 6e8, endurance_limit = 2.5e8 }
sections.rod = { shape = "circle", diameter = "3 mm" }
supports = { foot = ["ux", "uy", "uz", "ry"], top = ["ux", "uz"] }
loads.push = { at = "top", direction = "-uy", force = "300 N" }
run = { speed = "600 rpm", revolutions = 0.01, start = "equilibrium" }

[members.rod]
nodes = ["foot", "middle", "top"]
elements = 2
material = "steel"
section = "rod"
geometric_stiffness = true
bow = "20 um"
"""
STEEL = Material(2e11, 0.3, 7800.0, ultimate_strength=6e8, endurance_limit=2.5e8)


class Cantilever:
    def __init__(self, axis, parts, member=None):
        self.mesh = chain((0, 0, 0), LENGTH * axis, parts, "bar")
        self.member = member or Member(STEEL, UNEQUAL)
        self.beams = build_beams(self.mesh, {"bar": self.member})
        self.dofs = dof_map(self.mesh, [("start", COMPONENTS)])
        self.axes = self.beams.triads[0]

    def solve_load(self, load, spread=None):
        u = static_displacement(stiffness(self.beams, self.dofs), load, self.dofs.names)
        return section_forces(self.beams, self.dofs.nodal(u), spread=spread)

    def model(self, **parts):
        return Model(self.mesh, {"bar": self.member}, {"start": COMPONENTS}, **parts)


def cut_resultant(bar, force, moment, arm):
    """Return N Vy Vz T My Mz at a cut: resultant of the loads beyond it, about it, in local axes."""
    about = moment + np.cross(arm * bar.axes[0], force)
    return np.concatenate([bar.axes @ force, bar.axes @ about])


def record_components(record, case, found, expected, tolerance, reason):
    scale = np.abs(expected).max()
    for name, computed, reference in zip(FORCES, found, expected, strict=True):
        zero = abs(reference) <= 1e-12 * scale
        record(
            source=STATICS, case=case, quantity=f"{name} at the root", unit="N" if name[0] in "NV" else "N m",
            reference=0.0 if zero else reference, computed=computed, tolerance=tolerance * scale, absolute=True,
            reason=reason,
        )  # fmt: skip


@pytest.mark.parametrize("component", range(6), ids=COMPONENTS)
@pytest.mark.parametrize("axis", AXES)
def test_section_forces_under_tip_load(record, axis, component):
    bar = Cantilever(AXES[axis], 3)
    six = 10.0 * np.eye(6)[component]
    found = bar.solve_load(bar.dofs.vector(bar.mesh.node("end"), six))
    root, tip = (cut_resultant(bar, six[:3], six[3:], arm) for arm in (LENGTH, 0.0))
    record_components(
        record, f"cantilever {axis}, {COMPONENTS[component]}", found[0, 0], root, 1e-9, "condition of 3 elements"
    )
    assert np.abs(found[-1, 1] - tip).max() <= 1e-9 * np.abs(root).max()


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("parts", [1, 5])
def test_section_forces_under_uniform_load(record, axis, parts):
    bar = Cantilever(AXES[axis], parts)
    q = np.array([30.0, 100.0, -70.0])
    spread = distributed_load(bar.beams, slice(0, parts), q)
    found = bar.solve_load(assemble_loads(bar.beams, spread, bar.dofs), spread)
    root = cut_resultant(bar, q * LENGTH, np.zeros(3), LENGTH / 2.0)
    record_components(record, f"cantilever {axis}, uniform load, {parts} elements", found[0, 0], root, 1e-9, "rounding")
    assert np.abs(found[-1, 1]).max() <= 1e-9 * np.abs(root).max()


def test_signs_under_uniform_load(record):
    """For an element along x with q along y, only Vy = q L and Mz = q L^2/2 act at the root."""
    bar = Cantilever(np.array([1.0, 0.0, 0.0]), 1)
    spread = distributed_load(bar.beams, slice(0, 1), 100.0 * bar.axes[1])
    found = bar.solve_load(assemble_loads(bar.beams, spread, bar.dofs), spread)
    expected = np.array([0.0, 100.0 * LENGTH, 0.0, 0.0, 0.0, 100.0 * LENGTH**2 / 2.0])
    record_components(record, "cantilever, q along local y", found[0, 0], expected, 1e-9, "rounding")


@pytest.mark.parametrize("plane", [1, 2], ids=["local y", "local z"])
def test_deflection_under_uniform_load(record, plane):
    """Consistent loads give the exact deflection at the node, q L^4/(8 E I), with an element in either plane."""
    bar = Cantilever(np.array([1.0, 0.0, 0.0]), 1)
    load = assemble_loads(bar.beams, distributed_load(bar.beams, slice(0, 1), 100.0 * bar.axes[plane]), bar.dofs)
    u = bar.dofs.nodal(static_displacement(stiffness(bar.beams, bar.dofs), load, bar.dofs.names))
    second_moment = {1: bar.beams.EIz, 2: bar.beams.EIy}[plane][0]
    record(
        source=STATICS, case=f"cantilever, uniform load along {'xyz'[plane]}", quantity="deflection at the end",
        unit="m", reference=100.0 * LENGTH**4 / (8.0 * second_moment), computed=float(u[-1, :3] @ bar.axes[plane]),
        tolerance=1e-9, reason="rounding",
    )  # fmt: skip


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("axis", AXES)
def test_section_forces_under_weight(record, axis, mass):
    bar = Cantilever(AXES[axis], 1, Member(STEEL, UNEQUAL, mass=mass))
    gravity = np.array([0.0, -9.81, 0.0])
    spread = element_weight(bar.beams, gravity)
    found = bar.solve_load(assemble_loads(bar.beams, spread, bar.dofs), spread)
    weight = STEEL.density * UNEQUAL.A * LENGTH * gravity
    root = cut_resultant(bar, weight, np.zeros(3), LENGTH / 2.0)
    record_components(record, f"cantilever {axis}, weight, {mass}", found[0, 0], root, 1e-9, "rounding")
    assert np.abs(found[0, 1]).max() <= 1e-9 * np.abs(root).max()


@pytest.fixture(scope="module", params=[Damping(), Damping(alpha=40.0, beta=7.46e-5)], ids=["undamped", "Rayleigh"])
def transient_bar(request):
    """Return the response of a bar with 0.3 kg at its tip to a sudden load: forces of its nodes at 201 instants."""
    bar, pull = Cantilever(AXES["skew"], 3), 50.0 * np.array([1.0, 2.0, -1.0, 0, 0, 0]) / math.sqrt(6.0)
    model = bar.model(
        masses={"tip": MassAt("end", PointMass(0.3))}, loads={"pull": GivenLoad(1.0, pull, "end")}, probes=("end",),
        damping=request.param,
    )  # fmt: skip
    problem = Problem(build_system(model, 1.0), ConstantSpeed(1.0), 2e-5, 200)
    fields = solve(problem, newmark(), save=SaveAt(field_every=1)).fields
    moved, moving, pushed = (bar.dofs.nodal(getattr(fields, name)) for name in Series._fields)
    forces = section_forces(bar.beams, moved, velocity=moving, acceleration=pushed, damping=request.param)
    return bar, pull, forces, (pushed + request.param.alpha * moving)[:, -1]


def test_dynamic_equilibrium_at_tip(transient_bar):
    """The end of the bar carries the load less inertia and damping of the mass: N = F - m (a + alpha v)."""
    bar, pull, forces, taken = transient_bar
    force = (pull[:3] - 0.3 * taken[:, :3]) @ bar.axes.T
    assert np.abs(forces[:, -1, 1, :3] - force).max() <= 1e-9 * np.abs(force).max()  # residual of a direct solve
    assert np.abs(forces[:, -1, 1, 3:]).max() <= 1e-9 * np.abs(forces[..., 3:]).max()
    assert np.ptp(forces[:, -1, 1, 0]) > 1.0  # check that the bar vibrates


def test_dynamic_equilibrium_at_inner_nodes(transient_bar):
    _, _, forces, _ = transient_bar
    jump = np.abs(forces[:, :-1, 1] - forces[:, 1:, 0]).reshape(-1, 6).max(axis=0)
    assert (jump <= 1e-9 * np.abs(forces).reshape(-1, 6).max(axis=0)[[0, 1, 1, 4, 4, 4]]).all()


@pytest.mark.parametrize("damping", [Damping(), Damping(alpha=200.0), Damping(beta=7.46e-5)], ids=str)
def test_section_force_at_damped_tip_equals_load(damping):
    """Only the load acts at the tip, so that the end of the last element carries it for any damping of the bar."""
    bar, push = Cantilever(AXES["along z"], 4), np.array([1000.0, 0, 0, 0, 0, 0])
    model = bar.model(loads={"push": GivenLoad(1.0, push, "end")}, probes=("end",), damping=damping)
    problem = Problem(build_system(model, 1.0), ConstantSpeed(1.0), 2e-5, 400)
    structure, shown = build_structure(model), output_geometry(model)
    strength = StrengthSink(structure)
    fields = solve(problem, newmark(), save=SaveAt(field_every=1), sinks=[strength]).fields
    nodal = [structure.dofs.nodal(getattr(fields, name)) for name in Series._fields]
    found = shown.recover_fields(*nodal)
    assert np.abs(found["section_force"][:, -1] - bar.axes @ push[:3]).max() <= 1e-9 * 1000.0  # of a direct solve
    assert np.ptp(found["section_force"][:, 0], axis=0).max() > 100.0  # check that the bar vibrates
    assert strength.members()["bar"].von_mises == pytest.approx(found["stress_von_mises"].max(), rel=1e-12)


def test_section_forces_at_corner_belong_to_the_axes_of_the_point():
    """A cantilever along x turns to y at its corner; the vectors of the two sides have different components there."""
    nodes = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0]])
    mesh = Mesh(nodes, {"bar": np.arange(3)}, {"start": np.array([0]), "end": np.array([2])})
    push = np.array([7.0, 11.0, -13.0, 0.0, 0.0, 0.0])
    model = Model(
        mesh, {"bar": Member(STEEL, UNEQUAL)}, {"start": COMPONENTS}, loads={"push": GivenLoad(1.0, push, "end")}
    )
    system, structure, shown = build_system(model, 1.0), build_structure(model), output_geometry(model)
    u = equilibrium(system, ConstantSpeed(1.0)).displacement
    nodal = structure.dofs.nodal(u[None])
    found, constant = shown.recover_fields(nodal, 0.0 * nodal, 0.0 * nodal), constant_data(shown)
    axes = np.array([constant[name][0][1] for name in ("axis_x", "axis_y", "axis_z")])
    assert axes[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert found["section_force"][0, 1] == pytest.approx(axes @ push[:3], rel=1e-9, abs=1e-9)
    moment = axes @ np.cross(nodes[2] - nodes[1], push[:3])
    assert found["section_moment"][0, 1] == pytest.approx(moment, rel=1e-9, abs=1e-9)


def uniform_section_forces(**forces):
    """Return section forces of an element, equal at both ends."""
    return np.tile([forces.get(name, 0.0) for name in FORCES], (1, 2, 1))


def test_stresses_of_round_shaft(record):
    d, M, T, N = 0.03, 120.0, 80.0, 5e3
    rod = fibres([2 * [Section.circle(d)]])
    sigma, tau = 32.0 * M / (math.pi * d**3), 16.0 * T / (math.pi * d**3)
    both = uniform_section_forces(N=N, T=T, My=0.6 * M, Mz=0.8 * M)
    full = math.hypot(sigma + 4.0 * N / (math.pi * d**2), math.sqrt(3.0) * tau)
    rows = [
        ("32 M/(pi d^3)", sigma, rod.bending(both)), ("16 T/(pi d^3)", tau, rod.shear(both)),
        ("von Mises", full, rod.von_mises(both)),
    ]  # fmt: skip
    for quantity, reference, computed in rows:
        record(
            source="Strength of materials", case="round shaft", quantity=quantity, unit="Pa", reference=reference,
            computed=computed[0, 0], tolerance=1e-13, reason="a few operations",
        )  # fmt: skip


@pytest.mark.parametrize("My", [0.0, 50.0, -50.0])
@pytest.mark.parametrize("Mz", [0.0, 120.0, -120.0])
def test_normal_stress_of_rectangle(My, Mz):
    """The stress is N/A + My z/Iy - Mz y/Iz: a positive Mz compresses +y, a positive My stretches +z."""
    h, b, N = 0.03, 0.02, 4e3
    stress = fibres([2 * [Section.rectangle(h, b)]]).normal(uniform_section_forces(N=N, My=My, Mz=Mz))[0, 0]
    corners = [
        N / (b * h) + 6.0 * (My * z / (h * b**2) - Mz * y / (b * h**2)) for y in (-1.0, 1.0) for z in (-1.0, 1.0)
    ]
    assert (stress.min(), stress.max()) == pytest.approx((min(corners), max(corners)), rel=1e-12)


@pytest.mark.parametrize(
    ("ratio", "k2"), [(1.0, 0.208), (1.2, 0.219), (1.5, 0.231), (2.0, 0.246), (3.0, 0.267), (10.0, 0.312)]
)
@pytest.mark.parametrize("upright", [True, False])
def test_torsional_stress_of_rectangle(record, ratio, k2, upright):
    b, T = 0.01, 20.0
    sides = (ratio * b, b) if upright else (b, ratio * b)
    tau = fibres([2 * [Section.rectangle(*sides)]]).shear(uniform_section_forces(T=T))[0, 0]
    record(
        source="Timoshenko and Goodier, sec. 109", case=f"rectangle {ratio:g} : 1", quantity="k2 = T/(tau a b^2)",
        unit="1", reference=k2, computed=T / (tau * ratio * b**3), tolerance=5.5e-4, absolute=True,
        reason="half a unit of the last digit printed, and as much again for its rounding",
    )  # fmt: skip


def strength_sink(material, tension, torsion=0.0, angle=None):
    """Return a sink that has recorded a bar with a history of normal stress and a steady torsional stress, Pa."""
    bar = Cantilever(np.array([1.0, 0, 0]), 1, Member(material, Section.circle(0.01)))
    structure = build_structure(bar.model())
    fields = np.outer(tension, bar.dofs.vector(1, np.eye(6)[0])) * LENGTH / material.E
    fields += bar.dofs.vector(1, np.eye(6)[3]) * torsion * LENGTH / (material.G * 0.005)
    still, at = np.zeros_like(fields), np.zeros(len(tension)) if angle is None else angle
    series, empty = Series(fields, still, still), Series(*3 * [np.zeros((len(tension), 0))])
    sink = StrengthSink(structure)
    for part in (slice(0, 20), slice(20, None)):  # two blocks: extremes cover both of them
        sink.write(
            Block(at[part], at[part], empty, np.zeros((len(tension), 0))[part], at[part], at[part], series.at(part))
        )
    return sink


def bar_strength(material, tension, torsion=0.0):
    """Return the strength of the bar of `strength_sink`."""
    return strength_sink(material, tension, torsion).members()["bar"]


@pytest.mark.parametrize(
    ("turns", "count", "stresses"),
    [
        (1, 24, None), (2, 48, ("bar", 1e8, 2e8)), (3, 72, ("bar", 2e8, 3e8)),
        (2.5, 60, ("bar", 2e8, 3e8)), (2, 37, None),
    ],
)  # fmt: skip
def test_stress_change_between_last_revolutions(turns, count, stresses):
    """The stress increases by 100 MPa per revolution; the first instant of a revolution belongs to the previous one.

    The last two revolutions end with the run; they are compared only at equal cam angles.
    """
    angle = np.linspace(0.0, 2.0 * math.pi * turns, count + 1)
    tension = 1e8 * np.maximum(np.ceil(angle / (2.0 * math.pi) - 1e-9), 1.0)
    found = strength_sink(STEEL, tension, angle=angle).change()
    assert found == (stresses and (stresses[0], *map(pytest.approx, stresses[1:])))


@pytest.mark.parametrize(("mean", "amplitude"), [(1e8, 8e7), (0.0, 1e8), (-1e8, 5e7)])
def test_goodman_factor(record, mean, amplitude):
    """The factor is 1/(sigma_a/S_e + sigma_m/S_ut); a compressive mean does not increase it."""
    found = bar_strength(STEEL, mean + amplitude * np.sin(np.arange(81) * math.pi / 40.0))
    expected = 1.0 / (amplitude / STEEL.endurance_limit + max(mean, 0.0) / STEEL.ultimate_strength)
    assert (found.mean, found.alternating) == pytest.approx((mean, amplitude), rel=1e-9, abs=1e-3)
    assert found.von_mises == pytest.approx(abs(mean) + amplitude, rel=1e-9)
    record(
        source="Shigley, eq. 6-46", case=f"mean {mean / 1e6:g} MPa, amplitude {amplitude / 1e6:g} MPa",
        quantity="Goodman's factor", unit="1", reference=expected, computed=found.safety, tolerance=1e-9,
        reason="rounding",
    )  # fmt: skip


@pytest.mark.parametrize("mean", [0.0, -1e8])
def test_torsion_counts_under_compression(mean):
    """The steady torsional stress counts for either sign of the normal stress."""
    found = bar_strength(STEEL, mean + 5e7 * np.sin(np.arange(81) * math.pi / 40.0), torsion=2e8)
    expected = 1.0 / (5e7 / STEEL.endurance_limit + math.sqrt(3.0) * 2e8 / STEEL.ultimate_strength)
    assert found.safety == pytest.approx(expected, rel=1e-9)


def test_steady_compression_has_unlimited_life(tmp_path):
    """Goodman's line has no limit there; the place is still that of maximum stress, at mid-height."""
    (tmp_path / "rod.toml").write_text(COMPRESSED_ROD, encoding="utf-8")
    ready = prepare(read_case(tmp_path / "rod.toml"))
    sink = StrengthSink(build_structure(ready.model))
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    found = sink.members()["rod"]
    assert (found.safety, found.rated, found.place) == (None, True, "middle")
    assert found.mean == pytest.approx(-found.von_mises, rel=1e-9)
    assert "unlimited" in [*strength_table(sink).columns[4].cells]


def camshaft_strength(turns):
    """Return the strength of a camshaft under a lateral load that rotates `turns` times per revolution."""
    model = prepare(read_case("cases/tayeb/model-1-shm.toml")).model
    structure, angle = build_structure(model), np.linspace(0.0, 2.0 * math.pi, 73)
    axis = next(iter(model.cam_contacts.values())).shaft_axis
    across = np.array([0.0, 500.0, 300.0]) * (1.0 - np.abs(axis))
    loads = [np.cos(turns * one) * across + np.sin(turns * one) * np.cross(axis, across) for one in angle]
    rows = np.array([structure.row(model.cams["intake"].at, np.append(load, np.zeros(3))) for load in loads])
    fields, none = np.linalg.solve(structure.stiffness.dense(), rows.T).T, np.zeros((len(angle), 0))
    sink = StrengthSink(structure)
    series = Series(fields, np.zeros_like(fields), np.zeros_like(fields))
    sink.write(Block(angle, angle, Series(none, none, none), none, angle, angle, series))
    return sink.members()["camshaft"]


def test_load_rotating_with_shaft_gives_steady_stress():
    """Shaft and bearings are equal in both planes."""
    found = camshaft_strength(1.0)
    assert found.alternating < 1e-6 * found.von_mises
    assert abs(found.mean) == pytest.approx(found.von_mises, rel=4e-3)  # 36 points on the outline


def test_constant_load_on_rotating_shaft_alternates(record):
    """In rotating bending the stress of a constant moment alternates about zero at a point of the surface."""
    found = camshaft_strength(0.0)
    assert abs(found.mean) < 1e-9 * found.alternating
    record(
        source="Shigley, sec. 6-1", case="rotating shaft under a constant load", quantity="stress amplitude",
        unit="Pa", reference=found.von_mises, computed=found.alternating, tolerance=4e-3,
        reason="36 points on the outline, seen every 5 degrees",
    )  # fmt: skip


def test_no_safety_factor_without_strengths():
    assert bar_strength(replace(STEEL, endurance_limit=None), np.linspace(0.0, 1e8, 40)).safety is None


@pytest.mark.parametrize("seed", range(3))
def test_section_forces_are_invariant_under_rotation(seed):
    """A bar rotated in space with its load has the same local forces."""
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    six = np.array([3.0, -20.0, 10.0, 1.0, 2.0, -1.5])
    found = []
    for R in (np.eye(3), turn):
        member = Member(STEEL, UNEQUAL, orientation=tuple(R @ [0.0, 1.0, 0.0]))
        bar = Cantilever(R @ [1.0, 0, 0], 2, member)
        load = np.concatenate([R @ six[:3], R @ six[3:]])
        found.append(bar.solve_load(bar.dofs.vector(2, load)))
    assert np.abs(found[1] - found[0]).max() <= 1e-9 * np.abs(found[0]).max()  # condition of two elements
