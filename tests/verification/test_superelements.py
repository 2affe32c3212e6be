"""Superelements exported from a beam match the beam, in any format and with condensed modes.

The matrices are those of the elements of `flexcam.fem`, whose nodes between the ends are internal unknowns. With all
modes of the fixed interface the reduction of Craig and Bampton only changes the unknowns; with few of them the lowest
frequencies are accurate to four digits (R. R. Craig and M. C. C. Bampton, AIAA Journal 6 (1968)).
"""

import numpy as np
import pytest
from scipy.io import mmwrite

from flexcam import InputError, Mesh, build_model, prepare, read_case, read_result, run
from flexcam.analysis.run import open_result_file
from flexcam.case.reader import case_from_result
from flexcam.cli.main import main
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import dof_map
from flexcam.fem.sections import Material, Section
from flexcam.io.matrix_file import read_matrix
from flexcam.valvetrain import build_structure
from flexcam.valvetrain.modes import model_modes

SOURCE = "Superelements"
CASE = """
format = 1
nodes = { foot = ["20 mm", 0, "50 mm"], tip = ["120 mm", "80 mm", "50 mm"], end = ["120 mm", "120 mm", "50 mm"] }
sections = { rod = { shape = "rectangle", width_y = "6 mm", width_z = "9 mm" } }
materials = { steel = { E = "200 GPa", nu = 0.3, density = 7800 } }
supports = { foot = ["ux", "uy", "uz", "rx", "ry", "rz"] }
masses = { head = { at = "end", mass = "50 g" } }
springs = { valve = { at = "end", direction = "uy", stiffness = "30 kN/m", installed_force = "50 N" } }
loads = { push = { at = "tip", direction = "ux", force = "20 N" } }
run = { speed = "3000 rpm", steps_per_revolution = 1000, revolutions = 0.2, start = "rest" }
output = { probes = ["tip", "end"] }

[members]
stem = { nodes = ["tip", "end"], material = "steel", section = "rod" }
BODY
"""
BEAM = 'arm = { nodes = ["foot", "tip"], elements = 4, material = "steel", section = "rod", orientation = [0, 0, 1] }'
ARM = """
[superelements.arm]
nodes = { 1 = "foot", 2 = "tip" }
units = "m-kg-s"
stiffness = "K.mtx"
mass = "M.mtx"
"""


def arm_matrices():
    """Return stiffness and mass of the free arm, both ends first."""
    inner = np.linspace([0.02, 0.0, 0.05], [0.12, 0.08, 0.05], 5)
    mesh = Mesh(inner[[0, 4, 1, 2, 3]], {"arm": [0, 2, 3, 4, 1]}, {})
    member = Member(Material(2e11, 0.3, 7800.0), Section.rectangle(0.006, 0.009), (0.0, 0.0, 1.0))
    elements, dofs = build_beams(mesh, {"arm": member}), dof_map(mesh, ())
    return stiffness(elements, dofs).dense(), mass(elements, dofs).dense()


def write_list(path, matrix):
    """Write one triangle of a matrix as lines of node, component, node, component, value."""
    lines = ["** written by hand", "*MATRIX, TYPE=ANY"]
    for i, j in np.argwhere(np.tril(matrix)).tolist():
        lines.append(f"{i // 6 + 1}, {i % 6 + 1}, {j // 6 + 1}, {j % 6 + 1}, {float(matrix[i, j])!r}")
    path.write_text("\n".join(lines), encoding="utf-8")


def write_punch(path, matrix):
    """Write one triangle of a matrix as DMIG cards with wide fields, which are too short for sixteen digits."""
    lines = [f"DMIG    {path.stem}AAX           0       6       2       0{len(matrix):24d}"]
    for j in range(len(matrix)):
        lines.append(f"DMIG*   {path.stem + 'AAX':16}{j // 6 + 1:16d}{j % 6 + 1:16d}")
        below = [i for i in range(j, len(matrix)) if matrix[i, j]]
        lines += [f"*       {i // 6 + 1:16d}{i % 6 + 1:16d}{matrix[i, j]:16.9E}".replace("E", "D") for i in below]
    path.write_text("\n".join(lines), encoding="utf-8")


@pytest.fixture
def case(tmp_path):
    """Return a function that builds the case with the beam or with its superelement."""

    def make(body=ARM, change=lambda K, M: (K, M), write=mmwrite, overrides=()):
        for name, matrix in zip(("K", "M"), change(*arm_matrices()), strict=True):
            write(tmp_path / f"{name}.mtx", matrix)
        path = tmp_path / "arm.toml"
        path.write_text(CASE.replace("BODY", body), encoding="utf-8")
        return read_case(path, overrides)

    return make


def natural_frequencies(case, count=6):
    """Return the lowest natural frequencies, Hz, and the kinetic energies."""
    found = model_modes(build_structure(build_model(case)), count)
    return found.modes.omegas / (2.0 * np.pi), found.shares


@pytest.mark.parametrize("write", [mmwrite, write_list, write_punch])
def test_superelement_frequencies_match_beam(record, case, write):
    reference, _ = natural_frequencies(case(BEAM))
    computed, shares = natural_frequencies(case(write=write))
    for i in range(6):
        record(source=SOURCE, case=f"beam, {write.__name__}", quantity=f"frequency {i + 1}", unit="Hz",
               reference=reference[i], computed=computed[i], tolerance=1e-6, reason="digits of the file")  # fmt: skip
    assert all(sum(one.values()) == pytest.approx(1.0) for one in shares)
    assert shares[0]["superelement arm"] > 0.0


def test_check_shows_mass_and_centre_of_superelement(case, tmp_path, capsys):
    """The mass of the arm is 7800 kg/m^3 * 54 mm^2 * 128.06 mm = 53.94 g."""
    case()
    with pytest.raises(SystemExit, match="0"):
        main(["check", str(tmp_path / "arm.toml")])
    assert "0.05394 kg, centre of gravity (70, 40, 50) mm" in " ".join(capsys.readouterr().out.split())


def test_superelement_response_matches_beam(record, case):
    beam, body = run(case(BEAM)), run(case())
    for probe in ("end.uy", "tip.ux", "tip.rz"):
        reference, computed = (one[probe].displacement for one in (beam, body))
        far = float(np.abs(reference).max())
        record(source=SOURCE, case="beam under a force", quantity=f"largest error of {probe} over its largest value",
               unit="1", reference=0.0, computed=np.abs(computed - reference).max() / far, tolerance=1e-6,
               absolute=True, reason="digits of the file")  # fmt: skip


def test_superelement_weight_matches_beam(record, case):
    overrides = ("run.gravity=[0, '-9.81 m/s^2', 0]", "run.start=equilibrium", "run.revolutions=0.01")
    beam, body = (run(case(one, overrides=overrides))["end.uy"].displacement[0] for one in (BEAM, ARM))
    record(source=SOURCE, case="beam under its weight", quantity="end.uy in equilibrium", unit="m", reference=beam,
           computed=body, tolerance=1e-6, reason="digits of the file")  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda K, M: (K * (1.0 + 0.02j), M), "complex numbers"), (lambda K, M: (K[:11, :11], M), "11 rows")],
)
def test_unsupported_matrices_raise_error(case, change, words):
    with pytest.raises(InputError, match=words):
        case(change=change)


def test_frequency_with_few_modes(record, case):
    reference, _ = natural_frequencies(case(BEAM), 3)
    computed, _ = natural_frequencies(case(overrides=["superelements.arm.modes=4"]), 3)
    record(source=SOURCE, case="beam with 4 of 18 modes", quantity="frequency 3", unit="Hz", reference=reference[2],
           computed=computed[2], tolerance=1e-3, reason="truncated modes")  # fmt: skip
    assert prepare(case(overrides=["superelements.arm.modes=0"])).problem.system.size == 12


CAM = [
    "nodes.cam=[0.12, -0.03, 0.05]",
    'supports.foot=["ux", "uy", "uz", "rx", "ry"]',
    'cams.exhaust={ at = "cam", axis = [0, 0, 1], law = "4-5-6-7", lift = "5 mm", rise = "60 deg", return = "60 deg" }',
    'contacts.cam={ cam = "exhaust", follower = "tip", direction = "uy", model = "bilateral", stiffness = "100 MN/m" }',
    "loads={}",
    "run.start=equilibrium",
]


@pytest.mark.parametrize("kind", ["rigid", "beams"])
def test_contact_force_of_finger_superelement(record, case, kind):
    beam, body = (run(case(text, overrides=[*CAM, f"fidelity.model={kind}"])) for text in (BEAM, ARM))
    reference, computed = (one.channels["contacts.cam.force"] for one in (beam, body))
    assert np.abs(reference).max() > 50.0
    record(source=SOURCE, case=f"finger under a cam, {kind}", quantity="largest error over the largest force",
           unit="1", reference=0.0, computed=np.abs(computed - reference).max() / np.abs(reference).max(),
           tolerance=1e-6, absolute=True, reason="digits of the file")  # fmt: skip


def test_units_in_millimetres(case):
    """The stiffness is in N/mm, N and N mm, the mass in t, t mm and t mm^2."""

    def converted(K, M):
        scale = np.tile([1e-3] * 3 + [1.0] * 3, len(K) // 6)
        return 1e3 * scale[:, None] * K * scale, 1e3 * scale[:, None] * M * scale

    reference, _ = natural_frequencies(case())
    computed, _ = natural_frequencies(case(ARM.replace("m-kg-s", "mm-t-s"), converted))
    assert computed == pytest.approx(reference, rel=1e-6)


def test_rounded_matrices_have_rigid_body_modes(case):
    """Rounding to nine digits would constrain the free body."""
    rounded = lambda K, M: tuple(np.vectorize(lambda x: float(f"{x:.8e}"))(one) for one in (K, M))  # noqa: E731
    text = 'supports={ end = ["rx"] }'
    system = prepare(case(change=rounded, overrides=[text, "springs={}", "loads={}"])).problem.system
    assert system.free is not None
    assert system.free.shape[1] == 5


def change_stiffness_entry(K, M):
    K = K.copy()
    K[0, 0] *= 1.1
    return K, M


def make_asymmetric(K, M):
    K = K.copy()
    K[0, 5] += 1e6
    return K, M


def negate_mass(K, M):
    return K, -M


def double_mass_along_y(K, M):
    factor = np.where(np.arange(len(M)) % 6 == 1, 2.0, 1.0)
    return K, M * np.sqrt(np.outer(factor, factor))


def remove_rotations(K, M):
    keep = np.arange(len(K)) % 6 < 3
    return K * np.outer(keep, keep), M


@pytest.mark.parametrize(
    ("change", "overrides", "message"),
    [
        (change_stiffness_entry, (), "a stiffness against rigid motion: x"),
        (lambda K, M: (K, M), ["nodes.foot=[0, 0, 0]"], "a stiffness against rigid motion: rotation"),
        (make_asymmetric, (), "a symmetric matrix"),
        (negate_mass, (), "a positive semi-definite matrix"),
        (double_mass_along_y, (), "the same mass along x, y and z"),
        (remove_rotations, (), "internal|further motions without strain energy"),
        (lambda K, M: (K[:6, :6], M[:6, :6]), (), "The files have no entry of them"),
        (lambda K, M: (K, M), ["superelements.arm.nodes.2=nowhere"], "nowhere"),
        (lambda K, M: (K, M), ["superelements.arm.nodes.2=foot"], "different nodes"),
        (lambda K, M: (K, M), ["superelements.arm.mass=none.mtx"], "none.mtx"),
        (lambda K, M: (K, M), ["superelements.arm.units=inch"], "units"),
    ],
)
def test_invalid_matrices_raise_error(case, change, overrides, message):
    with pytest.raises(InputError, match=message):
        build_model(case(change=change, overrides=overrides))


@pytest.mark.parametrize("text", ["", "1, 1, 1\n", "1, 7, 1, 7, 2.0\n", "1, 1, 1, 1, nan\n", "%%MatrixMarket what\n"])
def test_damaged_files_raise_error(case, text, tmp_path):
    case()
    (tmp_path / "K.mtx").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"superelements\.arm\.stiffness"):
        read_case(tmp_path / "arm.toml")


# Written by pyNastran 1.4.1, `BDF.add_dmig` and `write_bdf`, except the last matrix: small fields and exponents without
# a letter, two entries per line, as in the MSC Nastran Quick Reference Guide.
PUNCH = """\
$pyNastran: punch=True
GRID,1,,0.,0.,0.
DMIG*               KAAX               0               6               2
*                      0               0                               4
DMIG*               KAAX               1               1
*                      1               12.5000000000D+06
DMIG*               KAAX               1               1
*                      1               2-1.250000000D+03
DMIG*               KAAX               1               1
*                     12               1-2.500000000D+06
DMIG*               KAAX               1               2
*                      1               24.0000000000D+05
DMIG*               KAAX               7               6
*                      7               63.1415926536D+01
DMIG*               KAAX              12               1
*                     12               12.5000000000D+06

DMIG    MAAX    0       1       1       0                       4
DMIG    MAAX    1       1               1       1       1.-4
        12      1       2.5-5
DMIG    MAAX    12      1               1       1       2.5-5
        12      1       1.+0            7               3.
DMIG,BAAX,0,6,2,0,,,1
DMIG,BAAX,7,,,7,,0.5
DMIG,CAAX,0,6,3,0,,,1
"""


def test_read_matrices_of_punch_file(tmp_path):
    path = tmp_path / "body.pch"
    path.write_text(PUNCH, encoding="utf-8")
    K, M, B = (read_matrix(path, "table", name=name) for name in ("KAAX", "MAAX", "BAAX"))
    assert K.labels == ((1, 1), (1, 2), (7, 6), (12, 1))
    expected = [[2.5e6, -1250, 0, -2.5e6], [-1250, 4e5, 0, 0], [0, 0, 31.415926536, 0], [-2.5e6, 0, 0, 2.5e6]]
    assert K.values.tolist() == expected
    assert M.labels == ((1, 1), (7, 1), (12, 1))
    assert M.values.tolist() == [[1e-4, 0, 2.5e-5], [0, 0, 3.0], [2.5e-5, 0, 1.0]]
    assert (B.labels, B.values.tolist()) == (((7, 1),), [[0.5]])
    for name, words in ((None, "KAAX, MAAX, BAAX, CAAX"), ("KAAY", "KAAX"), ("CAAX", "real numbers")):
        with pytest.raises(InputError, match=words):
            read_matrix(path, "table", name=name)


def test_case_selects_matrix_of_punch_file(case, tmp_path):
    reference, _ = natural_frequencies(case())
    case(write=write_punch)
    text = "\n".join((tmp_path / f"{name}.mtx").read_text(encoding="utf-8") for name in ("K", "M"))
    (tmp_path / "arm.pch").write_text(text, encoding="utf-8")
    body = ARM.replace('"K.mtx"', '{ file = "arm.pch", matrix = "KAAX" }')
    body = body.replace('"M.mtx"', '{ file = "arm.pch", matrix = "MAAX" }')
    assert natural_frequencies(case(body, write=write_punch))[0] == pytest.approx(reference, rel=1e-6)
    with pytest.raises(InputError, match="one of KAAX, MAAX"):
        case(body.replace(', matrix = "KAAX"', ""), write=write_punch)
    with pytest.raises(InputError, match="no Nastran punch file"):
        case(ARM.replace('"K.mtx"', '{ file = "K.mtx", matrix = "KAAX" }'))


FULL_MODEL = {
    "clamped at its pivot": (["supports.pivot=['ux', 'uy', 'uz', 'rx', 'ry', 'rz']"],
                             [7871.910, 8068.188, 21596.65, 23078.72, 25356.46, 31362.50]),
    "on its pivot and tip": (["supports.tip=['uy']"], [7871.910, 8000.287, 21596.65, 25356.46, 26767.10, 31907.41]),
}  # fmt: skip
"""Supports, and frequencies of the 2112 unknowns by CalculiX 2.20: output of meshes/calculix_rocker.py."""


@pytest.mark.parametrize("support", FULL_MODEL)
def test_frequencies_of_calculix_rocker(record, support):
    held, expected = FULL_MODEL[support]
    # an open lash separates the valve and its spring from the rocker; a spring of 1 kN/m remains at the pad
    case = read_case("cases/calculix-rocker/rocker.toml", [*held, "springs.valve.elements=1"])
    found = natural_frequencies(case, 8)[0]
    found = found[found > 5000.0]
    for i, reference in enumerate(expected):
        record(source=SOURCE, case=f"rocker of CalculiX, {support}", quantity=f"frequency {i + 1}", unit="Hz",
               reference=reference, computed=found[i], tolerance=1e-3,
               reason="24 modes with a fixed interface; truncation raises frequencies")  # fmt: skip
    assert (found[:6] > 0.999999 * np.array(expected)).all()  # Rayleigh: never below those of the full model


def test_train_with_calculix_rocker():
    response = run(read_case("cases/calculix-rocker/rocker.toml"))
    assert response.status.ok
    lift = -response["valve.uy"].displacement
    pad = response["pad.uy"].displacement
    on = lift > 1e-3
    np.testing.assert_allclose(lift[on], 1.6 * pad[on] - 0.15e-3, atol=5e-5)
    assert response.channels["contacts.intake.force"].min() >= 0.0


def test_result_file_contains_matrices(case, tmp_path):
    made = case(overrides=["output.field_every=5"])
    ready = prepare(made)
    sink = open_result_file(ready, tmp_path / "results")
    run(made, sinks=[sink])
    for name in ("K.mtx", "M.mtx"):
        (tmp_path / name).unlink()
    again = build_model(case_from_result(read_result(sink.path)))
    assert np.array_equal(again.superelements["arm"].mass, ready.model.superelements["arm"].mass)
    assert again.mesh.bodies["arm"].tolist() == ready.model.mesh.bodies["arm"].tolist()
