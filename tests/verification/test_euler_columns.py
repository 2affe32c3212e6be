"""Buckling of columns, K + lambda K_g: S. P. Timoshenko, J. M. Gere, Theory of Elastic Stability, 2nd ed., ch. 2.

P L^2/EI with n equal elements; the digits are those of an independent script. A single pinned-pinned element has ends
that turn by -r and r, so that 2 EI/L r = P L/6 r, which gives 12.
"""

import math

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from flexcam import build_model, prepare, read_case
from flexcam.analysis.run_checks import check_input
from flexcam.fem.assembly import Member
from flexcam.fem.sections import Material, Section
from flexcam.valvetrain import buckling_load, build_structure, stiff_struts

SOURCE = "Euler columns, cubic elements"
DIGITS = {
    "pinned-pinned": {1: 12.0, 2: 9.94385, 4: 9.87466, 8: 9.86993, 10: 9.86974},
    "fixed-free": {1: 2.48596, 2: 2.46866, 4: 2.46748, 8: 2.46741, 10: 2.46740},
}
EXACT = {"pinned-pinned": math.pi**2, "fixed-free": math.pi**2 / 4, "fixed-fixed": 4 * math.pi**2}
LENGTH, SECTION, STEEL = 1.7, Section.circle(0.02), Material(2e11, 0.3, 7800.0)


def critical_load(plane_beam, supports, elements):
    beam = plane_beam(Member(STEEL, SECTION), LENGTH, elements, supports)
    bends = [i for i, name in enumerate(beam.dofs.names) if not name.endswith("ux")]
    pick = np.ix_(bends, bends)
    K, G = beam.stiffness.dense()[pick], beam.geometric(-1.0).dense()[pick]
    largest = eigh(-G, K, eigvals_only=True)[-1]
    return LENGTH**2 / (STEEL.E * SECTION.Iz * largest)


CASES = [(supports, n) for supports, table in DIGITS.items() for n in table]


@pytest.mark.parametrize(("supports", "elements"), CASES)
def test_critical_load_factors(record, plane_beam, supports, elements):
    record(
        source=SOURCE, case=supports, quantity=f"P L^2/EI, {elements} elements", unit="1",
        reference=DIGITS[supports][elements], computed=critical_load(plane_beam, supports, elements), tolerance=5.1e-6,
        absolute=True, reason="half a unit of the last digit given",
    )  # fmt: skip


@pytest.mark.parametrize("supports", sorted(EXACT))
def test_fourth_order_convergence_to_euler_load(record, plane_beam, fitted_order, supports):
    counts = np.array([4, 8, 16, 32])
    errors = [critical_load(plane_beam, supports, n) / EXACT[supports] - 1 for n in counts]
    assert min(errors) > 0.0  # a displacement method is too stiff
    record(
        source=SOURCE, case=supports, quantity="order of convergence in h", unit="1", reference=4.0,
        computed=fitted_order(1 / counts, errors), tolerance=0.1, absolute=True,
        reason="cubic elements: 2 (p + 1 - m) = 4; fitted over 4 to 32 elements",
    )  # fmt: skip


ROD = """
format = 1
nodes = {{ root = [0.1, 0.0, 0.0], tip = {tip} }}
materials.steel = {{ E = "207 GPa", nu = 0.29, density = "7800 kg/m^3" }}
sections.tube = {{ shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }}
members.rod = {{ nodes = ["root", "tip"], elements = 8, material = "steel", section = "tube" }}
supports = {supports}
[run]
speed = "60 rpm"
"""
RIGIDITY = 207e9 * Section.tube(0.008, 0.005).Iz


def rod_buckling_load(path):
    return buckling_load(build_model(read_case(path)), "rod")


@pytest.mark.parametrize("supports", ["{}", '{ root = ["ux", "uy", "uz"] }', '{ root = ["uy"], tip = ["uz"] }'])
@pytest.mark.parametrize("tip", [(0.35, 0.0, 0.0), (0.25, 0.16, -0.12)])
def test_unsupported_ends_are_hinged(tmp_path, supports, tip):
    """Springs or other members support the rod: Euler's load is independent of its direction and of other supports."""
    path = tmp_path / "rod.toml"
    path.write_text(ROD.format(tip=list(tip), supports=supports), encoding="utf-8")
    # Eight cubic elements are (pi/8)^4/720 = 3.3e-5 too stiff.
    assert rod_buckling_load(path) == pytest.approx(math.pi**2 * RIGIDITY / 0.25**2, rel=4e-5)


HINGE_AND_GUIDE = 'root = ["ux", "uy", "uz"]', 'tip = ["uy", "uz", "rx", "ry", "rz"]'
HINGED_CLAMPED_LOAD = 4.493409457909064**2
"""Load factor of a column hinged at one end and clamped at the other: tan x = x."""


@pytest.mark.parametrize("elements", [1, 2, 3, 4])
def test_coarse_members_are_subdivided(record, tmp_path, elements):
    """The critical load of a single element between hinge and guide would be 30 E I/L^2."""
    path = tmp_path / "rod.toml"
    text = ROD.format(tip=[0.35, 0.0, 0.0], supports="{ " + ", ".join(HINGE_AND_GUIDE) + " }")
    path.write_text(text.replace("elements = 8", f"elements = {elements}"), encoding="utf-8")
    record(
        source=SOURCE, case="hinged and clamped, divided", quantity=f"P L^2/EI, {elements} elements", unit="1",
        reference=HINGED_CLAMPED_LOAD, computed=rod_buckling_load(path) * 0.25**2 / RIGIDITY,
        tolerance=3e-3, reason="four cubic elements at least: (4.5/4)^4/720 = 2e-3",
    )  # fmt: skip


@pytest.mark.parametrize("elements", [1, 4, 5])
def test_end_on_rigid_link_is_hinged(tmp_path, elements):
    """The buckling load neglects other members and links with any number of elements: Euler's load, hinged column."""
    path = tmp_path / "rod.toml"
    text = ROD.format(tip=[0.35, 0.0, 0.0], supports="{ " + HINGE_AND_GUIDE[0] + " }").replace(
        "elements = 8", f"elements = {elements}"
    )
    text = text.replace("nodes = { ", "nodes = { body = [0.36, 0.02, 0.0], ", 1)
    text = text.replace("[run]", 'rigid_links.head = { from = "body", to = ["tip"] }\n[run]')
    path.write_text(text, encoding="utf-8")
    # Four cubic elements are (pi/4)^4/720 = 5.3e-4 too stiff.
    assert rod_buckling_load(path) == pytest.approx(math.pi**2 * RIGIDITY / 0.25**2, rel=6e-4)


COLUMN = """
format = 1
nodes = {{ a = [0, 0, 0], b = [0, {0}, 0], c = [0, {1}, 0], d = [0, {2}, 0] }}
materials.steel = {{ E = "207 GPa", nu = 0.29, density = "7800 kg/m^3" }}
sections = {{ plug = {{ shape = "circle", diameter = "7 mm" }}, tube = {{ shape = "circle", diameter = "{3} mm" }} }}
members.foot = {{ nodes = ["a", "b"], elements = 2, material = "steel", section = "plug" }}
members.tube = {{ nodes = ["{4}", "{5}"], elements = 4, material = "steel", section = "tube" }}
members.head = {{ nodes = ["c", "d"], elements = 2, material = "steel", section = "plug" }}
supports = {{ a = {6}, d = {7} }}
[run]
speed = "60 rpm"
"""
HINGES = ['["ux", "uy", "uz", "ry"]', '["ux", "uz"]']
CLAMPED = ['["ux", "uy", "uz", "rx", "ry", "rz"]', "[]"]


@pytest.mark.parametrize("ends", ["bc", "cb"])
@pytest.mark.parametrize(("supports", "factor"), [(HINGES, math.pi**2), (CLAMPED, math.pi**2 / 4.0)])
def test_members_in_a_line_buckle_together(tmp_path, supports, factor, ends):
    path = tmp_path / "column.toml"
    path.write_text(COLUMN.format(0.05, 0.2, 0.28, 7, *ends, *supports), encoding="utf-8")
    structure = build_structure(build_model(read_case(path)))
    load = factor * 207e9 * Section.circle(0.007).Iz / 0.28**2
    loads = [buckling_load(structure.model, name) for name in ("foot", "tube", "head")]
    assert loads == pytest.approx([load] * 3, rel=6e-4)  # of four cubic elements


def test_stepped_column_buckles_at_root_of_its_equation(tmp_path):
    """Ends of stiffness EI2 and length b, and a middle of length 2 c and EI1: tan(k2 b) tan(k1 c) = k2/k1."""
    path = tmp_path / "column.toml"
    path.write_text(COLUMN.format(0.05, 0.23, 0.28, 4, *"bc", *HINGES), encoding="utf-8")
    middle, end = (207e9 * Section.circle(d).Iz for d in (0.004, 0.007))

    def equation(load):
        k1, k2 = math.sqrt(load / middle), math.sqrt(load / end)
        return math.tan(k2 * 0.05) * math.tan(k1 * 0.09) - k2 / k1

    load = brentq(equation, 1.0, (math.pi / 0.18) ** 2 * middle * (1.0 - 1e-9))
    assert buckling_load(build_model(read_case(path)), "tube") == pytest.approx(load, rel=6e-4)


def test_guides_divide_member_into_spans(record, tmp_path):
    """The span between two guides with fixed slope has 4 pi^2, next to one hinged at its end."""
    path = tmp_path / "rod.toml"
    text = ROD.format(
        tip=[0.35, 0.0, 0.0],
        supports="{ " + ", ".join((*HINGE_AND_GUIDE, HINGE_AND_GUIDE[1].replace("tip", "guide"))) + " }",
    )
    text = text.replace('["root", "tip"], elements = 8', '["root", "guide", "tip"]')
    path.write_text(text.replace("nodes = { ", "nodes = { guide = [0.26, 0.0, 0.0], ", 1), encoding="utf-8")
    record(
        source=SOURCE, case="two guided spans of an element each", quantity="P L^2/EI of the longer one", unit="1",
        reference=HINGED_CLAMPED_LOAD, computed=rod_buckling_load(path) * 0.16**2 / RIGIDITY,
        tolerance=3e-3, reason="as above",
    )  # fmt: skip


CLAMPED = 'root = ["ux", "uy", "uz", "rx", "ry", "rz"]', HINGE_AND_GUIDE[1]
HINGED = HINGE_AND_GUIDE[0], 'tip = ["uy", "uz", "rx"]'


@pytest.mark.parametrize(
    ("supports", "elements", "excess"),
    [
        (HINGED, 1, 12.0 / math.pi**2 - 1.0),
        (HINGE_AND_GUIDE, 1, 30.0 / HINGED_CLAMPED_LOAD - 1.0),
        (CLAMPED, 1, math.inf),
        (HINGED, 2, None),
        (HINGE_AND_GUIDE, 2, None),
        (CLAMPED, 2, None),
    ],
)
def test_too_few_elements_for_geometric_stiffness_cause_warning(tmp_path, supports, elements, excess):
    """A run uses the given elements; a single element has the critical loads 12 and 30 E I/L^2."""
    path = tmp_path / "rod.toml"
    text = ROD.format(tip=[0.35, 0.0, 0.0], supports="{ " + ", ".join(supports) + " }")
    asked = f'elements = {elements}, geometric_stiffness = true, bow = "0.1 mm"'
    path.write_text(text.replace("elements = 8", asked), encoding="utf-8")
    case = read_case(path)
    stiff_members = stiff_struts(build_model(case))
    assert {name: enough for name, (_, enough) in stiff_members.items()} == ({"rod": 4} if excess else {})
    if excess:
        assert stiff_members["rod"][0] == pytest.approx(
            excess, rel=2e-2
        )  # four elements are up to 2e-3 too stiff themselves
        assert any("too few elements in member rod" in one for one in check_input(prepare(case)))
    plain = tmp_path / "plain.toml"
    plain.write_text(text.replace("elements = 8", f"elements = {elements}"), encoding="utf-8")
    assert not any("too few elements" in one for one in check_input(prepare(read_case(plain))))


@pytest.mark.parametrize("held", [("tip.uy", "tip.uz"), ("tip.uy", "tip.uz", "middle.uy", "middle.uz")])
def test_springs_to_ground_guide_a_member_as_supports_do(held, tmp_path):
    """The base is clamped; springs of 1 GN/m hold the same components as supports."""
    text = """
format = 1
nodes = { base = [0, 0, 0], middle = [0.15, 0, 0], tip = [0.3, 0, 0] }
materials.steel = { E = 207e9, nu = 0.29, density = 7800 }
sections.tube = { shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }
members.rod = { nodes = ["base", "middle", "tip"], elements = 4, material = "steel", section = "tube" }
run = { speed = "100 rpm" }
supports.base = ["ux", "uy", "uz", "rx", "ry", "rz"]
"""
    guides = {point: [each[-2:] for each in held if each.startswith(point)] for point in ("middle", "tip")}
    supports = "".join(f"supports.{point} = {parts}\n" for point, parts in guides.items() if parts).replace("'", '"')
    springs = "".join(
        f'springs.{each.replace(".", "-")} = {{ at = "{each[:-3]}", direction = "{each[-2:]}", stiffness = 1e9 }}\n'
        for each in held
    )
    loads = []
    for more in (supports, springs):
        (tmp_path / "rod.toml").write_text(text + more, encoding="utf-8")
        loads.append(buckling_load(build_model(read_case(tmp_path / "rod.toml")), "rod"))
    assert loads[1] == pytest.approx(loads[0], rel=1e-3)  # the springs give way by 1e-4
    assert loads[0] > 1.9 * math.pi**2 * 207e9 * math.pi / 64.0 * (8e-3**4 - 5e-3**4) / 0.09


def test_soft_spring_at_hinged_end_does_not_lower_buckling_load():
    """The rocker guides the end of the pushrod along z; a centring spring there is no guide."""
    template = "flexcam/templates/pushrod-engine.toml"
    free = 'supports.pushrod-top=["ux"]', 'supports.tappet=["ux", "uz", "ry"]'

    def load(*more):
        return buckling_load(build_model(read_case(template, [*free, *more])), "pushrod")

    alone = load()
    for direction, stiffness in (("uz", 1e-6), ("uz", 1e3), ("rx", 1.0)):
        spring = f'springs.centre={{ at = "pushrod-top", direction = "{direction}", stiffness = {stiffness} }}'
        assert load(spring) == pytest.approx(alone, rel=0.02)
        assert load(spring) > alone * (1.0 - 1e-9)
