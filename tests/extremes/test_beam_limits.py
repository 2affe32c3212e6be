"""Beams of slenderness 2 to 1e5, up to 10 000 elements per span, and axial loads close to buckling.

Deflection of a cantilever: P L^3/(3 E I) + P L/(kappa G A). Its frequencies: Timoshenko's equation for a clamped-free
beam, with b^2 = rho A L^4 w^2/(E I), r^2 = I/(A L^2), s^2 = E I/(kappa G A L^2): T. C. Huang, J. Appl. Mech. 28 (1961).
Columns: S. P. Timoshenko, J. M. Gere, Theory of Elastic Stability, 2nd ed. (1961), secs. 1.4, 2.1.
"""

import math
import re

import numpy as np
import pytest
from scipy.optimize import brentq

from flexcam import build_model, modes, prepare, read_case, run
from flexcam.dynamics import Cause, ConstantSpeed, Problem, RunFailedError, State, newmark, solve, static_displacement
from flexcam.dynamics import modes as modes_of
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import COMPONENTS, direction, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Section
from flexcam.valvetrain import buckling_load, build_structure, train_metrics
from tests.pinned_rod import LENGTH, TUBE, pinned_rod, push
from tests.thinning import mostly_slow

SLENDER, ELEMENTS, AXIAL = "slenderness of a beam", "elements per span", "axial load"
DIAMETER, FIRST = 0.02, 1.8751040687119611
SECTION = Section.circle(DIAMETER)


class Cantilever:
    """A round cantilever as matrices, its tip load and its closed-form solutions."""

    def __init__(self, steel, length, elements, *, shear):
        mesh = chain((0, 0, 0), (length, 0, 0), elements)
        member = Member(steel, SECTION, shear=shear, rotary_inertia=shear)
        beams = build_beams(mesh, {"shaft": member})
        self.dofs = dof_map(mesh, [("start", COMPONENTS)])
        self.M, self.K = mass(beams, self.dofs), stiffness(beams, self.dofs)
        self.free = np.zeros((self.dofs.size, 0))
        self.steel, self.length, self.EI = steel, length, steel.E * SECTION.Iz
        self.shear = 1.0 / (SECTION.kappa_y * steel.G * SECTION.A) if shear else 0.0
        self.push = self.dofs.vector(elements, direction("uy"))

    def deflection(self):
        return float(self.push @ static_displacement(self.K, self.push, self.dofs.names, self.free))

    def exact_deflection(self):
        return self.length**3 / (3.0 * self.EI) + self.shear * self.length

    def lowest(self):
        return modes_of(self.M, self.K, 2, free=self.free)

    def exact_omega(self):
        """Return the first angular frequency; the search is from b = 0.1 to just above Euler-Bernoulli's."""
        unit = math.sqrt(self.EI / (self.steel.density * SECTION.A * self.length**4))
        r2, s2 = SECTION.Iz / (SECTION.A * self.length**2), self.shear * self.EI / self.length**2
        if not s2:
            return FIRST**2 * unit

        def missing(b):
            root = math.sqrt((r2 - s2) ** 2 + 4.0 / b**2)
            a1, a2 = (b * math.sqrt(0.5 * (side * (r2 + s2) + root)) for side in (-1.0, 1.0))
            both = 2.0 + (b**2 * (r2 - s2) ** 2 + 2.0) * math.cosh(a1) * math.cos(a2)
            return both - b * (r2 + s2) / math.sqrt(1.0 - b**2 * r2 * s2) * math.sinh(a1) * math.sin(a2)

        return brentq(missing, 0.1, FIRST**2 * 1.01, xtol=1e-14) * unit


@pytest.mark.parametrize("slenderness", [2, 5, 10, 100, 1e3, 1e4, 1e5])
@pytest.mark.parametrize("shear", [True, False], ids=["Timoshenko", "Euler-Bernoulli"])
def test_slender_and_stubby_cantilevers_match_theory(expect, steel, slenderness, shear):
    beam = Cantilever(steel, slenderness * DIAMETER, 20, shear=shear)
    given = f"{'Timoshenko' if shear else 'Euler-Bernoulli'} cantilever, length {slenderness:g} diameters, 20 elements"
    # Rounding of K: eps n^4 = 4e-11, bounded with all terms of a row by ten times that.
    expect.right(SLENDER, given, what="deflection per force", unit=" m/N", reference=beam.exact_deflection(),
                 computed=beam.deflection(), tolerance=4e-10)  # fmt: skip
    # The discretization error, (b_1/20)^4/1440 = 5e-8; for a stubby Timoshenko beam that of its rotary inertia,
    # at most (b_1/20)^2 times the contribution of shear and rotary inertia.
    part = abs(
        beam.exact_omega() / (FIRST**2 * math.sqrt(beam.EI / (steel.density * SECTION.A)) / beam.length**2) - 1.0
    )
    expect.right(SLENDER, given, what="first omega", unit=" rad/s", reference=beam.exact_omega(),
                 computed=beam.lowest().omegas[0], tolerance=1e-7 + (FIRST / 20) ** 2 * part)  # fmt: skip


def relative_bound(elements):
    """Return rounding of the bending stiffness on n elements relative to the lowest energy, eps n^4 (Fried 1972)."""
    return float(np.finfo(float).eps) * elements**4


@pytest.mark.parametrize("elements", [1, 10, pytest.param(100, marks=pytest.mark.slow), 1000])
def test_up_to_1000_elements_keep_four_digits(expect, steel, elements):
    beam = Cantilever(steel, 1.0, elements, shear=False)
    given = f"cantilever, {elements} elements per span"
    expect.right(ELEMENTS, given, what="deflection per force", unit=" m/N", reference=beam.exact_deflection(),
                 computed=beam.deflection(), tolerance=relative_bound(elements) + 1e-14)  # fmt: skip
    expect.right(ELEMENTS, given, what="first omega", unit=" rad/s", reference=beam.exact_omega(),
                 computed=beam.lowest().omegas[0],
                 tolerance=(FIRST / elements) ** 4 / 1440 + relative_bound(elements))  # fmt: skip


def test_modes_of_2000_elements_warn_of_rounding(expect, steel):
    beam = Cantilever(steel, 1.0, 2000, shear=False)
    found = beam.lowest()
    assert abs(found.omegas[0] / beam.exact_omega() - 1.0) <= found.rounding[0]
    expect.warns(ELEMENTS, "cantilever, 2000 elements per span, modes", found.describe_rounding(), "rounding", r"\d %")


FINE = """
format = 1
nodes = { root = [0.0, 0.0, 0.0], tip = [1.0, 0.0, 0.0] }
materials.steel = { E = "207 GPa", nu = 0.29, density = "7800 kg/m^3" }
sections.round = { shape = "circle", diameter = "20 mm" }
members.rod = { nodes = ["root", "tip"], elements = 2000, material = "steel", section = "round" }
supports = { root = ["ux", "uy", "uz", "rx", "ry", "rz"] }
loads.push = { at = "tip", direction = "uy", force = "100 N" }
run = { speed = "60 rpm", step = "10 us", revolutions = 3e-5, start = "equilibrium" }
output.probes = ["tip"]
"""


@pytest.mark.parametrize("asked", mostly_slow(["check", "modes", "run"]))
def test_commands_with_2000_elements_warn_of_rounding(expect, command, tmp_path, asked):
    (tmp_path / "fine.toml").write_text(FINE, encoding="utf-8")
    code, output = command(asked, "fine.toml")
    assert code == 0
    warning = re.search(r"Warning: rounding.*?%", output, re.DOTALL)
    expect.warns(ELEMENTS, f"flexcam {asked}, cantilever, 2000 elements per span", warning[0] if warning else output,
                 "rounding", r"\d %")  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "elements"),
    [
        ("deflection", 3000),
        ("deflection", 10_000),
        ("lowest", 3000),
        pytest.param("lowest", 10_000, marks=pytest.mark.slow),
    ],
)
def test_3000_or_more_elements_are_refused(expect, steel, elements, asked):
    with pytest.raises(RunFailedError) as refusal:
        getattr(Cantilever(steel, 1.0, elements, shear=False), asked)()
    assert refusal.value.status.cause is Cause.ROUNDING
    what = "deflection" if asked == "deflection" else "modes"
    expect.refuses(ELEMENTS, f"cantilever, {elements} elements per span, {what}", str(refusal.value.status),
                   "rounding in the stiffness", "fewer elements")  # fmt: skip


@pytest.fixture
def column(tmp_path):
    """Return a function that makes the case of a pinned tube under a fraction of its computed critical load."""

    def make(part, bow=0.0):
        path = tmp_path / "column.toml"
        path.write_text(pinned_rod(bow), encoding="utf-8")
        own = buckling_load(build_model(read_case(path)), "rod")
        path.write_text(pinned_rod(bow, push(-part * own)), encoding="utf-8")
        return read_case(path)

    return make


def test_critical_load_matches_euler(expect, steel, column):
    structure = build_structure(build_model(column(0.0)))
    euler = math.pi**2 * steel.E * TUBE.Iz / LENGTH**2
    # Eight cubic elements are (pi/8)^4/720 = 3.3e-5 too stiff.
    expect.right(AXIAL, "pinned column of 8 elements", what="critical load over Euler's", reference=1.0,
                 computed=buckling_load(structure.model, "rod") / euler, tolerance=4e-5)  # fmt: skip


def test_bow_growth_and_frequency_below_critical_load(expect, column):
    part, bow = 0.999, 1e-6
    deeper = run(column(part, bow))["mid.uy"].displacement[-1]
    # Cubic elements approximate the half sine to 3e-5 of the critical load, 1/(1 - part) times in the deflection; the
    # load is relative to the computed critical load, so the error is that of the bow's shape, (pi d/L)^2/8 of d.
    expect.right(AXIAL, f"column with a bow of 1 um, P = {part} of its critical load", what="bow grows by a factor of",
                 reference=part / (1.0 - part), computed=deeper / bow, tolerance=1e-4)  # fmt: skip
    found = modes(column(part), 2, prestress="equilibrium").modes.omegas[0]
    free = modes(column(0.0), 2).modes.omegas[0]
    expect.right(AXIAL, f"straight column, P = {part} of its critical load", what="omega over that without load",
                 reference=math.sqrt(1.0 - part), computed=found / free, tolerance=1e-4)  # fmt: skip


def test_modes_above_critical_load_are_refused(expect, column):
    with pytest.raises(RunFailedError) as refusal:
        modes(column(1.001), 2, prestress="equilibrium")
    expect.refuses(AXIAL, "straight column, P = 1.001 of its critical load, modes", str(refusal.value.status),
                   "members.rod.bending buckles or folds over", "a member buckles")  # fmt: skip


@pytest.mark.parametrize(
    ("bow", "name"), [(0.0, "straight column"), pytest.param(1e-6, "column with a bow of 1 um", marks=pytest.mark.slow)]
)
def test_statics_above_critical_load_is_refused(expect, column, bow, name):
    case = column(1.001, bow)
    message = "answered"
    try:
        run(case)
    except RunFailedError as refusal:
        message = str(refusal.status)
    expect.refuses(
        AXIAL, f"{name}, P = 1.001 of its critical load, statics", message, "members.rod.bending buckles or folds over"
    )


def test_run_above_critical_load_reports_margin_below_one(expect, column):
    """A lateral velocity makes the straight column diverge; the buckling margin in the run's table is below one."""
    start = prepare(column(0.999)).problem.start.displacement * (1.001 / 0.999)
    case = column(1.001)
    ready = prepare(read_case(case.path, ['run.start="rest"']))
    velocity = np.where([name == "mid.uy" for name in ready.problem.system.names], 1e-6, 0.0)
    response = solve(Problem(ready.problem.system, ConstantSpeed(1.0), 1e-4, 200, State(start, velocity)), newmark())
    assert np.abs(response["mid.uy"].displacement[-1]) > np.abs(response["mid.uy"].displacement[100]) > 0.0
    margin = {f.name: f.value for f in train_metrics(ready.model, response, 1.0)}["members.rod.buckling_margin"]
    assert margin == pytest.approx(1.0 / 1.001, rel=1e-6)
    expect.warns(AXIAL, "straight column, P = 1.001 of its critical load, run",
                 f"members rod buckling margin {margin:.4g}", r"buckling margin 0\.999")  # fmt: skip
