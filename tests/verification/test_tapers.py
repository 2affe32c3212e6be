"""Tapered members against closed forms.

The lowest frequencies of a cone and of a wedge with a clamped base and a sharp tip are those of G. Kirchhoff (1879), as
given by R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), table 8-9: ``lambda^2 = 8.719`` and
``5.315`` with the section of the base. The elongation of a bar of linearly varying diameter is ``4 F L/(pi E d1 d2)``.
"""

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run
from flexcam.analysis.run_checks import check_input
from flexcam.case.input_checks import check_values
from flexcam.fem.assembly import sections_at_nodes
from flexcam.fem.recovery import fibres
from flexcam.fem.sections import Section, Taper
from flexcam.valvetrain import build_structure
from flexcam.valvetrain.modes import model_modes

SOURCE = "Tapered members"
E, RHO, L = 2e11, 7800.0, 0.5
CASE = f"""
format = 1
nodes = {{ foot = [0, 0, 0], tip = [{L}, 0, 0] }}
materials = {{ steel = {{ E = {E}, nu = 0.3, density = {RHO} }} }}
sections = {{ rod = {{ SECTION }} }}
members = {{ rod = {{ nodes = ["foot", "tip"], elements = ELEMENTS, material = "steel", section = "rod" }} }}
supports = {{ foot = ["ux", "uy", "uz", "rx", "ry", "rz"] }}
run = {{ speed = "3000 rpm", steps_per_revolution = 720, revolutions = 0.1, start = "equilibrium" }}
output = {{ probes = ["tip"] }}
"""


def rod_case(tmp_path, section, elements, more=""):
    path = tmp_path / f"rod-{elements}.toml"
    path.write_text(CASE.replace("SECTION", section).replace("ELEMENTS", str(elements)) + more)
    return read_case(path)


def bending_frequency(case, axis):
    """Return the lowest bending frequency along an axis."""
    found = model_modes(build_structure(build_model(case))).modes
    names = build_structure(build_model(case)).dofs.names
    along = np.abs(found.shapes[[i for i, name in enumerate(names) if name.endswith(axis)]]).max(axis=0)
    across = np.abs(found.shapes[[i for i, name in enumerate(names) if name[-2] == "u" and not name.endswith(axis)]])
    return found.frequencies[along > 10.0 * across.max(axis=0)][0]


TIP = 1e-4  # of the base: a section cannot vanish; the tip changes the frequency by less than its own size


@pytest.mark.parametrize(
    ("name", "section", "factor", "radius"),
    [
        ("cone", f'shape = "circle", diameter = [0.02, {0.02 * TIP}]', 8.719, 0.005),
        ("wedge", f'shape = "rectangle", width_y = [0.02, {0.02 * TIP}], width_z = 0.02', 5.315, 0.02 / np.sqrt(12.0)),
    ],
)
def test_frequencies_of_cantilevers_with_sharp_tip(tmp_path, record, name, section, factor, radius):
    wanted = factor / (2.0 * np.pi * L**2) * radius * np.sqrt(E / RHO)
    found = [bending_frequency(rod_case(tmp_path, section, n), "uy") for n in (40, 80)]
    record(source=SOURCE, case=name, quantity="frequency 1", unit="Hz", reference=wanted, computed=found[1],
           tolerance=1e-3, reason="error of 80 elements, and four digits of the reference")  # fmt: skip
    assert abs(found[1] - wanted) < 0.5 * abs(found[0] - wanted)


def test_elongation_of_cone(tmp_path, record):
    """Elements with the section at mid-length have second order."""
    thick, thin, force = 0.012, 0.006, 5000.0
    load = f'loads = {{ pull = {{ at = "tip", direction = "ux", force = {force} }} }}\n'
    wanted = 4.0 * force * L / (np.pi * E * thick * thin)
    errors = []
    for elements in (4, 8, 16):
        found = run(rod_case(tmp_path, f'shape = "circle", diameter = [{thick}, {thin}]', elements, load))
        errors.append(abs(found["tip"].displacement[-1, 0] / wanted - 1.0))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.05)
    record(source=SOURCE, case="cone under tension, 16 elements", quantity="relative error of the elongation", unit="1",
           reference=0.0, computed=errors[-1], tolerance=1e-3, reason="second order", absolute=True)  # fmt: skip


def test_stress_at_both_ends_of_cone(tmp_path):
    """The stress of an axial force follows the section at each node, not that at the middle of the element."""
    model = build_model(rod_case(tmp_path, 'shape = "circle", diameter = ["12 mm", "6 mm"]', 2))
    at = fibres(list(sections_at_nodes(model.mesh, model.members).values()))
    forces = np.zeros((2, 2, 6))
    forces[..., 0] = 5000.0
    wanted = 5000.0 / (np.pi / 4.0 * np.array([[0.012, 0.009], [0.009, 0.006]]) ** 2)
    assert at.axial(forces) == pytest.approx(wanted, rel=1e-12)


def test_tapered_tube_of_constant_wall():
    section = Taper(Section.tube, (0.02, 0.016), (0.012, 0.008)).at(0.5)
    assert section == Section.tube(0.016, 0.012)


def test_torsion_constant_of_taper_raises_error(tmp_path):
    with pytest.raises(InputError, match="no J of a tapered section"):
        rod_case(tmp_path, 'shape = "circle", diameter = ["12 mm", "6 mm"], J = 1e-9', 2)


@pytest.mark.parametrize(("elements", "wanted"), [(2, 11), (10, 11), (11, None)])
def test_too_few_elements_for_taper_cause_warning(tmp_path, elements, wanted):
    """The second moment decreases to a sixteenth: 11 elements change it by less than 1.3 each, 1.3^11 = 17.9."""
    warnings = check_input(prepare(rod_case(tmp_path, 'shape = "circle", diameter = ["12 mm", "6 mm"]', elements)))
    messages = [one for one in warnings if "second moment changes" in one]
    assert [one.rpartition("= ")[2] for one in messages] == ([str(wanted)] if wanted else [])


def test_check_of_thousands_of_elements(tmp_path):
    """1.3 to the power of 3000 exceeds the range of floating-point numbers."""
    assert not check_values(rod_case(tmp_path, 'shape = "circle", diameter = "12 mm"', 3000))
