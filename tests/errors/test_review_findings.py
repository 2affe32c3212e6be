"""What a review found: ambiguous names, things listed twice, data a part cannot use, limits, defaults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexcam import InputError, modes, prepare, read_case, run
from flexcam.fem.sections import Section

CIRCLE = 'shaft = { shape = "circle", diameter = "25 mm" }'
CUSTOM = 'shaft = { shape = "custom", A = "490 mm^2", Iy = "19000 mm^4", Iz = "12000 mm^4", J = "30000 mm^4" }'
VALVE = 'valve = { at = "valve", mass = "0.10 kg" }'


def words(faults):
    return [f"{fault.where}: {fault.given}; {fault.allowed}; {fault.why}; {fault.remedy}" for fault in faults]


@pytest.fixture
def read(tmp_path):
    def make(text, overrides=()):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, overrides)

    return make


@pytest.mark.parametrize(
    ("old", "new", "where", "said"),
    [
        ('to = "valve"', 'to = "cam"', "rockers.rocker", "'cam'"),
        ('to = "valve"', 'to = "pushrod-top"', "rockers.rocker", "'pushrod-top'"),
        ('probes = ["valve", "cam"]', 'probes = ["valve", "cam", "valve"]', "output.probes", "'valve'"),
        (VALVE, VALVE.replace("}", ", inertia = [1e-5, 1e-5, 1e-5] }"), "masses.valve", "inertia"),
        (VALVE, VALVE.replace("}", ', offset = ["1 mm", 0, 0] }'), "masses.valve", "offset"),
    ],
    ids=["named like a mesh point", "named like its own start", "probe twice", "inertia", "offset"],
)
def test_refused(text, changed, faults_of, old, new, where, said):
    found = words(faults_of(changed(text, (old, new))))
    assert any(one.startswith(where) and said in one for one in found), found


def test_modal_damping_of_a_large_model(text, changed, faults_of):
    """Above 600 unknowns: refused, and what to write instead is said."""
    fine = changed(
        text, ('material = "steel", section = "shaft" }', 'material = "steel", section = "shaft", elements = 60 }'),
        ('start = "rest"', 'start = "rest"\ndamping = { modal = 0.02 }'),
    )  # fmt: skip
    found = faults_of(fine)
    assert [fault.where.split(" ")[0] for fault in found] == ["run.damping.modal"]
    assert "unknowns" in found[0].given
    assert "alpha" in found[0].remedy
    assert "beta" in found[0].remedy


def test_modal_damping_of_a_small_model(text, changed, read):
    ready = prepare(read(changed(text, ('start = "rest"', 'start = "rest"\ndamping = { modal = 0.02 }'))))
    assert ready.problem.system.damping.dense().any()


def test_custom_section_without_fibres(text, changed, read):
    """Twice the radius of gyration: exact for a solid circle, on the safe side for a rectangle."""
    section = read(changed(text, (CIRCLE, CUSTOM))).record.sections["shaft"].part
    assert section.fibre_y == pytest.approx(2.0 * math.sqrt(12000e-12 / 490e-6), rel=1e-12)
    assert section.fibre_z == pytest.approx(2.0 * math.sqrt(19000e-12 / 490e-6), rel=1e-12)
    for same in (Section.circle(0.03), Section.rectangle(0.03, 0.02)):
        given = Section(same.A, same.Iy, same.Iz, same.J)
        assert given.fibre_y >= same.fibre_y * (1.0 - 1e-12)
        assert given.fibre_z >= same.fibre_z * (1.0 - 1e-12)


def test_custom_section_with_fibres(text, changed, read):
    more = CUSTOM.replace(" }", ', fibre_y = "9 mm", fibre_z = "11 mm", torsion_arm = "8 mm" }')
    section = read(changed(text, (CIRCLE, more))).record.sections["shaft"].part
    assert (section.fibre_y, section.fibre_z, section.torsion_arm) == pytest.approx((0.009, 0.011, 0.008))


def test_a_mass_added_on_the_command_line(text, read):
    case = read(text, ["masses.new.at=cam", "masses.new.mass=1kg"])
    assert case.record.masses["new"].mass == 1.0
    heavy, plain = (prepare(one).problem.system for one in (case, read(text)))
    at = plain.names.index("cam.uy")
    assert (heavy.mass.diagonal() - plain.mass.diagonal())[at] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("override", "meant"),
    [("mases.new.mass=1kg", "masses"), ("runn.speed=3000rpm", "run"), ("masses.new.mas=1kg", "mass"),
     ("outptu.field_every=3", "output")],
)  # fmt: skip
def test_near_misses_on_the_command_line(text, read, override, meant):
    with pytest.raises(InputError) as refusal:
        read(text, ["masses.new.at=cam", "masses.new.mass=1kg", override])
    assert any(f"Did you mean {meant!r}" in str(fault) for fault in refusal.value.faults), words(refusal.value.faults)


def test_near_miss_of_a_table(text, changed, faults_of):
    found = words(faults_of(changed(text, ("[masses]", "[mases]"))))
    assert any("did you mean 'masses'" in one for one in found), found


BEAM = """
format = 1
[nodes]
root = [0, 0, 0]
tip = ["300 mm", 0, 0]
[materials.light]
E = "207 GPa"
nu = 0.29
density = 0
[sections]
rod = {{ shape = "circle", diameter = "10 mm" }}
[members]
rod = {{ nodes = ["root", "tip"], material = "light", section = "rod", elements = {elements} }}
[supports]
root = ["ux", "uy", "uz", "rx", "ry", "rz"]
[masses]
body = {{ at = "tip", mass = "0.5 kg", offset = ["20 mm", 0, 0] }}
[loads.pull]
at = "tip"
direction = "uy"
force = "10 N"
[run]
speed = "60 rpm"
revolutions = 0.05
step = "50 us"
[output]
probes = ["tip"]
"""


@pytest.mark.parametrize("elements", [1, 3, 120])
def test_a_massless_beam_with_an_offset_mass(read, elements):
    """Bending of m on a rigid arm c: omega^2 = 1/(m (L^3/3 + L^2 c + L c^2)/EI), twice; axial EA/(L m).

    120 elements leave rounding eps n^4 = 4e-8 in K.
    """
    case = read(BEAM.format(elements=elements))
    EI, A, L, c, m = 207e9 * math.pi * 0.01**4 / 64.0, math.pi * 0.01**2 / 4.0, 0.3, 0.02, 0.5
    bending = math.sqrt(EI / (m * (L**3 / 3.0 + L**2 * c + L * c**2)))
    found = modes(case).modes
    assert found.rigid == 0
    assert found.omegas == pytest.approx([bending, bending, math.sqrt(207e9 * A / L / m)], rel=1e-6)


@pytest.mark.parametrize("elements", [1, 3, 120])
def test_it_runs(read, elements):
    """Under a sudden load it swings about the deflection: up to twice the static one of its mass's centre."""
    response = run(read(BEAM.format(elements=elements)))
    assert response.status.ok
    static = 10.0 * 0.3**3 / (3.0 * 207e9 * math.pi * 0.01**4 / 64.0)
    assert np.isfinite(response["tip"].displacement).all()
    assert np.abs(response["tip"].displacement[:, 1]).max() == pytest.approx(2.0 * static, rel=0.05)
