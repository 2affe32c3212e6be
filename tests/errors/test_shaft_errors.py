"""Faults of rotating members that are not round and of cams of one shaft with opposite axes."""

import re
from dataclasses import replace

import pytest

from flexcam import InputError, RunFailedError, prepare, read_case
from flexcam.case.builder import build_model
from flexcam.case.starters import new_case

SHAFT = 'shaft = { shape = "circle", diameter = "25 mm" }'
CUSTOM = 'shaft = {{ shape = "custom", A = 4.9e-4, Iy = 1.9e-8, Iz = {}, J = 3.8e-8 }}'
OTHER = """[cams.other]
at = "front"
{}law = "shm"
lift = "6 mm"
rise = "180 deg"
return = "180 deg"

[contacts.other]
cam = "other"
follower = "lifter"
direction = "uy"
model = "bilateral"
stiffness = "10 MN/m"

[contacts.intake]"""
LIFTER = [
    ('pushrod-top = [', 'lifter = ["60 mm", "18 mm", "0 mm"]\npushrod-top = ['),
    ('tappet = ["ux", "uz", "ry"]', 'tappet = ["ux", "uz", "ry"]\nlifter = ["ux", "uz", "rx", "ry", "rz"]'),
    ('follower = { at', 'lifter = { at = "lifter", mass = "0.1 kg" }\nfollower = { at'),
]  # fmt: skip


@pytest.fixture
def read_text(tmp_path):
    def read_written_text(text):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path)

    return read_written_text


@pytest.fixture
def build_faults(text, substitute, read_text):
    def find(*changes):
        with pytest.raises(InputError) as refusal:
            build_model(read_text(substitute(text, *changes)))
        return refusal.value.faults

    return find


@pytest.mark.parametrize(
    "section",
    ['shaft = { shape = "rectangle", width_y = "26 mm", width_z = "10 mm" }', CUSTOM.format(2.0e-8)],
)  # fmt: skip
def test_rotating_member_that_is_not_round_is_refused(build_faults, section):
    (fault,) = build_faults((SHAFT, section))
    assert re.match(r"members\.camshaft\.section \(line \d+\)", fault.where)
    assert "Iy = " in fault.given
    assert "Iz = " in fault.given
    assert "turns with cam 'intake'" in fault.why
    assert "circle" in fault.remedy


def test_unequal_shear_factors_are_refused_only_with_shear(build_faults, text, substitute, read_text):
    uneven = (SHAFT, 'shaft = { shape = "circle", diameter = "25 mm", kappa_y = 0.5 }')
    build_model(read_text(substitute(text, uneven)))
    (fault,) = build_faults(uneven, ("camshaft = { nodes", "camshaft = { shear = true, nodes"))
    assert "kappa_y = 0.5" in fault.given


@pytest.mark.parametrize("change", [
    (SHAFT, 'shaft = { shape = "rectangle", width_y = "20 mm", width_z = "20 mm" }'),
    (SHAFT, CUSTOM.format(1.905e-8)),
    ('tube = { shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }',
     'tube = { shape = "rectangle", width_y = "8 mm", width_z = "6 mm" }'),
])  # fmt: skip
def test_round_or_fixed_members_are_accepted(text, substitute, read_text, change):
    build_model(read_text(substitute(text, change)))


def test_shaft_without_bearings_is_named(tmp_path):
    """Gravity moves the shaft of the template gear-drive without its bearings; supports and gear hold only its axis."""
    case = read_case(new_case("gear-drive", tmp_path / "case.toml")[0])
    case = replace(case, record=case.record.model_copy(update={"bearings": {}}))
    with pytest.raises(RunFailedError, match=r"cams.intake: nothing holds the shaft.* add supports: bearings"):
        prepare(case)


def test_opposite_cam_axes_on_one_shaft_are_refused(build_faults):
    (fault,) = build_faults(*LIFTER, ("[contacts.intake]", OTHER.format("axis = [-1, 0, 0]\n")))
    assert re.match(r"cams\.\w+\.axis \(line \d+\)|cams\.\w+ \(line \d+\)", fault.where)
    assert "'intake'" in str(fault)
    assert "'other'" in str(fault)
    assert "[-1, 0, 0]" in fault.given


@pytest.mark.parametrize("axis", ["", "axis = [2, 0, 0]\n"])
def test_equal_cam_axes_on_one_shaft_are_accepted(text, substitute, read_text, axis):
    build_model(read_text(substitute(text, *LIFTER, ("[contacts.intake]", OTHER.format(axis)))))


def test_shaft_and_axis_faults_are_in_one_report(build_faults):
    rectangle = 'shaft = { shape = "rectangle", width_y = "26 mm", width_z = "10 mm" }'
    faults = build_faults((SHAFT, rectangle), *LIFTER, ("[contacts.intake]", OTHER.format("axis = [-1, 0, 0]\n")))
    assert {one.where.split(".")[0] for one in faults} == {"members", "cams"}
