"""Scenes: closed solids of correct volume, exact profiles, centre lines through nodes, positions of parts."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case
from flexcam.cams import LAWS, FlatFollower, LiftEvent, RollerFollower, SwingRollerFollower, cam_profile
from flexcam.case.builder import build_model
from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Material, Section
from flexcam.plotting.scene.mechanism import build_mechanism
from flexcam.plotting.scene.motion import (
    SceneState,
    case_motion,
    centre_line,
    mode_motion,
    rotation_matrices,
    sweep_outline,
)
from flexcam.plotting.scene.parts import CamPlacement, CoilSizes, coil_solid, lobe_solid
from flexcam.plotting.scene.solids import (
    CIRCLE_POINTS,
    Solid,
    ball,
    capsule,
    cylinder,
    loft,
    prism,
    ring,
    section_outlines,
)
from flexcam.valvetrain import build_structure
from tests.thinning import mostly_slow, slow_if

ROOT = Path(__file__).parents[2]
STEEL = Material(E=207e9, nu=0.29, density=7800.0)
FACETS = CIRCLE_POINTS / math.pi * math.sin(math.pi / CIRCLE_POINTS) * math.cos(math.pi / CIRCLE_POINTS)
"""Area of the polygon of a circle relative to the circle: exact volume reduction by facets."""

NO_TRAIN = (0, None, 0.0, 0.0)
"""Node, contact and sizes of a cam without train."""


def volume(solid):
    """Return the enclosed volume by the divergence theorem; negative with inward normals."""
    a, b, c = np.moveaxis(solid.points[solid.faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def is_closed(solid):
    """Return True if every edge belongs to two triangles with opposite directions."""
    edges = np.concatenate([solid.faces[:, [i, (i + 1) % 3]] for i in range(3)]).tolist()
    seen = {(a, b) for a, b in edges}
    return len(seen) == len(edges) and all((b, a) in seen for a, b in seen)


CASES = ["pushrod-engine/intake", "pushrod-engine/lever", "direct-acting/bucket", "direct-acting/finger",
         "camshaft-4cyl/camshaft", "li/valve-train", "petrescu/valve-spring", "tayeb/model-3-shm", "checks/cantilever",
         "checks/mathieu"]  # fmt: skip


def load_structure(name):
    return build_structure(build_model(read_case(ROOT / f"cases/{name}.toml")))


def bar(section, moved=None, length=0.3, direction=(1.0, 2.0, -0.5), shear=False, elements=3):
    along = length * np.array(direction) / np.linalg.norm(direction)
    nodes = np.linspace(0.0, 1.0, elements + 1)[:, None] * along
    mesh = Mesh(nodes, {"bar": np.arange(elements + 1)}, {})
    made = build_beams(mesh, {"bar": Member(STEEL, section, shear=shear)})
    nodal = np.zeros((elements + 1, 6)) if moved is None else moved
    return mesh, made, centre_line(made, slice(0, elements), mesh.nodes, nodal)


@pytest.mark.parametrize(
    ("section", "area"),
    [(Section.circle(0.02), math.pi * 1e-4 * FACETS), (Section.tube(0.02, 0.012), math.pi * 64e-6 * FACETS),
     (Section.rectangle(0.02, 0.01), 2e-4), (Section(A=3e-4, Iy=2e-9, Iz=8e-9, J=1e-9), 3e-4)],
    ids=["circle", "tube", "rectangle", "given"],
)  # fmt: skip
def test_straight_member_has_volume_of_section(section, area):
    """The volume is exact to rounding, including the facets of a circle."""
    _, _, line = bar(section)
    rings = [sweep_outline(outline, line) for outline in section_outlines(section)]
    there_and_back = rings[0] if len(rings) == 1 else np.concatenate([rings[0], rings[1][::-1]])
    solid = loft("member", there_and_back, cyclic=len(rings) == 2)
    assert is_closed(solid)
    assert volume(solid) == pytest.approx(0.3 * area, rel=1e-12)


def test_rectangle_sides_follow_local_axes():
    section = Section.rectangle(0.02, 0.01)
    mesh, made, line = bar(section)
    corners = (sweep_outline(section_outlines(section)[0], line)[0] - mesh.nodes[0]) @ made.triads[0].T
    assert np.abs(corners).max(axis=0) == pytest.approx([0.0, 0.01, 0.005], abs=1e-15)


@pytest.mark.parametrize("shear", [False, True])
def test_centre_line_passes_through_nodes_with_rotations(shear, rng):
    """Slopes equal the nodal rotations without shear; sections rotate with the nodes, also with shear."""
    moved = 1e-3 * rng.standard_normal((4, 6))
    mesh, made, line = bar(Section.circle(0.05), moved, shear=shear)
    at_nodes = np.flatnonzero(line.part == np.round(line.part))
    assert np.allclose(line.points[at_nodes], mesh.nodes + moved[:, :3], rtol=0.0, atol=1e-15)
    turned = made.triads[[0, 1, 2, 2]] @ rotation_matrices(moved[:, 3:])
    assert np.allclose(line.triads[at_nodes], turned, rtol=0.0, atol=1e-14)
    if not shear:
        fine = centre_line(made, slice(0, 3), mesh.nodes, moved, parts=4096)
        step = np.diff(fine.points[:2], axis=0)[0] @ made.triads[0].T * 4096 / made.length[0]
        slope = moved[0, 3:] @ made.triads[0].T
        assert step[1:] == pytest.approx([slope[2], -slope[1]], abs=3e-5)  # chord of 1/4096 of an element


def test_cantilever_deflection_matches_closed_form():
    """One element under an end load: v = F x^2 (3L - x)/6EI + F x/kappa A G, which the element represents exactly."""
    for shear in (False, True):
        section = Section.circle(0.05)
        mesh, made, _ = bar(section, length=0.3, direction=(1, 0, 0), shear=shear, elements=1)
        F, L, EI, phi = 1e3, 0.3, made.EIz[0], made.phi_y[0]
        sheared = phi * L**2 / (12.0 * EI) * F  # per length: phi = 12 EI/(kappa A G L^2)
        moved = np.zeros((2, 6))
        moved[1, 1], moved[1, 5] = F * L**3 / (3 * EI) + sheared * L, F * L**2 / (2 * EI)
        line = centre_line(made, slice(0, 1), mesh.nodes, moved)
        x = line.points[:, 0]
        assert line.points[:, 1] == pytest.approx(F * x**2 * (3 * L - x) / (6 * EI) + sheared * x, abs=1e-15)
        turned = np.arcsin(line.triads[:, 0, 1])
        assert turned == pytest.approx(
            F * (L * x - x**2 / 2) / EI, abs=1e-6 * turned.max()
        )  # the sections do not move along the axis
        assert shear == bool(phi)


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(20240)


def test_rotation_matrices_are_orthogonal(rng):
    made = rotation_matrices(rng.standard_normal((20, 3)))
    assert np.allclose(made @ np.swapaxes(made, 1, 2), np.eye(3), atol=1e-14)
    assert np.linalg.det(made) == pytest.approx(1.0)
    assert np.allclose(rotation_matrices(np.zeros((1, 3)))[0], np.eye(3))


EVENT = LiftEvent(LAWS["4-5-6-7"], 0.006, 1.3, 1.3, 0.0, 1.0)
FOLLOWERS = [FlatFollower(0.024), RollerFollower(0.02, 0.009, 0.003), SwingRollerFollower(0.016, 0.0085, 0.02, 0.0305),
             SwingRollerFollower(0.016, 0.0085, 0.02, 0.0305, -1)]  # fmt: skip


@pytest.mark.parametrize("cam_turn", [1, -1])
@pytest.mark.parametrize("follower", FOLLOWERS)
def test_lobe_matches_profile(follower, cam_turn):
    """Points of the solid are those of the profile at the same angles, and no point is inside the follower."""
    lift, axis = np.array([0.0, 0.6, 0.8]), np.array([-1.0, 0.0, 0.0])
    profile = cam_profile(EVENT, follower, count=360, turn=cam_turn)
    frame = CamPlacement(profile, np.zeros(3), lift, axis, 0.012, *NO_TRAIN)
    for angle in (0.0, 1.0, 2.3, 4.0):
        solid = lobe_solid(frame, angle, np.zeros(6))
        assert is_closed(solid)
        radii = np.linalg.norm(profile.points, axis=1)
        drawn = solid.points[:360] - solid.points[:360] @ axis[:, None] * axis
        assert np.sort(np.linalg.norm(drawn, axis=1)) == pytest.approx(np.sort(radii), rel=1e-12)
        area = volume(solid) / 0.012
        x, y = profile.points.T
        assert area == pytest.approx(abs(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))), rel=1e-12)
        lifted = float(EVENT(np.array([angle]))[0])
        touching = frame.contact_end(lifted)
        if np.isfinite(follower.roller_radius):
            away = np.abs(frame.contour(angle) - touching).min()
            assert away == pytest.approx(follower.roller_radius, abs=2e-5)  # between points a degree apart
        else:
            assert frame.contour(angle).imag.max() == pytest.approx(follower.base_radius + lifted, abs=1e-5)


@pytest.mark.parametrize("follower", FOLLOWERS)
def test_cam_rotates_about_its_axis(follower):
    axis = np.array([0.0, 0.0, 1.0])
    frame = CamPlacement(cam_profile(EVENT, follower), np.zeros(3), np.array([0.0, 1.0, 0.0]), axis, 0.01, *NO_TRAIN)
    contours = (frame.contour(angle) for angle in (0.2, 0.2 + 1e-6))
    before, after = (np.column_stack([one.real, one.imag]) @ frame.plane for one in contours)
    turned = np.cross(before, after) @ axis
    assert (turned > 0.0).all()


def test_follower_starts_along_lift_direction():
    for follower in FOLLOWERS:
        lift, axis = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
        frame = CamPlacement(cam_profile(EVENT, follower), np.zeros(3), lift, axis, 0.01, *NO_TRAIN)
        step = (frame.contact_end(1e-7) - frame.contact_end(0.0)) / 1e-7
        assert abs(step - 1j) < 1e-5


def test_volumes_match_closed_form():
    zero, axis = np.zeros(3), np.array([0.0, 0.0, 1.0])
    assert volume(cylinder("a", zero, 0.1 * axis, 0.02)) == pytest.approx(math.pi * 4e-5 * FACETS)
    assert volume(ring("a", zero, axis, (0.01, 0.02), 0.03)) == pytest.approx(math.pi * 3e-4 * 0.03 * FACETS)
    assert volume(ball("a", zero, 0.1)) == pytest.approx(4e-3 / 3.0 * math.pi, rel=0.02)  # 17 cones of 32 facets
    outline = capsule(0j, 0.1 + 0j, (0.03, 0.02))
    body = prism("a", outline, np.eye(3)[:2], zero, 0.01)
    open_by = math.acos(0.1)
    area = 0.05 * math.sqrt(0.1**2 - 0.01**2) + (math.pi - open_by) * 9e-4 + open_by * 4e-4
    assert volume(body) == pytest.approx(0.01 * area, rel=0.01)  # arcs of 16 points
    for solid in (cylinder("a", zero, axis, 1.0), ring("a", zero, axis, (1.0, 2.0), 1.0), ball("a", zero, 1.0), body):
        assert is_closed(solid)


def test_open_or_inverted_surface_is_detected():
    cube = cylinder("a", np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    assert not is_closed(Solid("a", cube.points, cube.faces[1:]))
    assert volume(Solid("a", cube.points, cube.faces[:, ::-1])) < 0.0


def test_coil_follows_ends_and_parts_of_spring():
    """The wire has the volume of its length; its ends follow those of the spring, and its middle the inner parts."""
    sizes, axis = CoilSizes(0.03, 0.004, 0.06, 6.0), np.array([0.0, 1.0, 0.0])
    at_rest = coil_solid(sizes, np.zeros(3), axis, np.zeros(2))
    assert is_closed(at_rest)
    turns = sizes.coils + 2.0
    length = turns * math.pi * 0.03
    assert volume(at_rest) == pytest.approx(length * math.pi * 0.002**2, rel=0.08)  # ten facets, pitch left out
    assert (at_rest.points[:, 1].min(), at_rest.points[:, 1].max()) == pytest.approx((0.0, 0.06), abs=2e-4)  # facets
    pressed = coil_solid(sizes, np.zeros(3), axis, np.array([0.0, 0.004, -0.01]))
    assert pressed.points[:, 1].max() == pytest.approx(0.05, abs=1e-3)
    # The parts move individually: the middle by 4 mm, off the straight line between the ends.
    assert (pressed.points - at_rest.points)[:, 1].max() == pytest.approx(0.004, rel=0.02)


@pytest.mark.parametrize("name", mostly_slow(CASES))
def test_solids_of_every_case_are_closed(name):
    structure = load_structure(name)
    motion, drawn = case_motion(structure, 100.0), build_mechanism(structure)
    kinds = []
    for i in (0, 60):
        solids = drawn.solids(motion.instant(i))
        assert all(is_closed(solid) and volume(solid) > 0.0 for solid in solids), [
            s.kind for s in solids if not is_closed(s)
        ]
        kinds.append([solid.kind for solid in solids])
    assert kinds[0] == kinds[1]


PARTS = {
    "pushrod-engine/intake": {"shaft": 1, "member": 1, "lobe": 1, "follower": 1, "rocker": 2, "spring": 2, "valve": 1,
                              "seat": 1, "drive": 1, "bearing": 3},
    "direct-acting/finger": {"shaft": 1, "lobe": 1, "roller": 1, "rocker": 2, "spring": 1, "valve": 1, "seat": 1},
    "direct-acting/bucket": {"shaft": 1, "member": 2, "lobe": 1, "follower": 1, "spring": 3, "valve": 1, "seat": 1},
    "camshaft-4cyl/camshaft": {"shaft": 1, "lobe": 8, "follower": 8, "spring": 8, "valve": 0, "bearing": 13,
                               "drive": 1},
    "li/valve-train": {"lobe": 1, "mass": 2, "spring": 3, "valve": 0},
}  # fmt: skip


@pytest.mark.parametrize("name", PARTS)
def test_number_of_parts_by_kind(name):
    structure = load_structure(name)
    solids = build_mechanism(structure).solids(case_motion(structure, 100.0).instant(0))
    counts = {kind: sum(solid.kind == kind for solid in solids) for kind in PARTS[name]}
    assert counts == PARTS[name]


def test_nested_springs_do_not_intersect():
    """The springs of valve and bucket are on one seat with clearance between their coils, also with default sizes."""
    structure = load_structure("direct-acting/bucket")
    drawn = build_mechanism(structure)
    outer, inner, light = ({one.name: one for one in drawn.springs}[name] for name in ("outer", "inner", "bucket"))
    for around, inside in ((outer, inner), (inner, light)):
        assert inside.sizes.diameter + inside.sizes.wire < around.sizes.diameter - around.sizes.wire
        assert inside.start == pytest.approx(around.start)
        assert not inside.ground
        assert not inside.retainer
    solids = drawn.solids(case_motion(structure, 100.0).instant(0))
    assert [sum(solid.kind == kind for solid in solids) for kind in ("retainer", "ground")] == [1, 1]


TRAINS = ["pushrod-engine/intake", "pushrod-engine/lever", "direct-acting/bucket", "direct-acting/finger"]


@pytest.mark.parametrize("name", slow_if(lambda name: name == "pushrod-engine/lever", TRAINS))
def test_cam_follower_and_valve_stay_in_contact(name):
    """The lobe touches its follower at all angles, and the valve opens by its lift, away from its seat."""
    structure = load_structure(name)
    motion, drawn = case_motion(structure, 100.0, count=24), build_mechanism(structure)
    gaps, opened = [], []
    for i in range(24):
        instant = motion.instant(i)
        solids = {solid.kind: solid for solid in drawn.solids(instant)}
        lift = drawn.cams[0].lift
        cam, touching = solids["lobe"].points @ lift, solids.get("roller", solids.get("follower"))
        if "roller" in solids:
            centre = touching.points.mean(axis=0)
            plane = drawn.cams[0].plane
            gaps.append(np.linalg.norm((solids["lobe"].points - centre) @ plane.T, axis=1).min() - 0.0085)
        else:
            gaps.append((touching.points @ lift).min() - cam.max())
        opened.append(float((solids["valve"].points @ drawn.valves[0].away).max()))
    assert np.abs(gaps).max() < 3e-5  # between the points of a profile a degree apart
    point = drawn.valves[0].point
    moved = [motion.instant(i).at(point, drawn.valves[0].away) @ drawn.valves[0].away for i in range(24)]
    assert np.array(opened) - opened[0] == pytest.approx(np.array(moved) - moved[0], abs=1e-12)
    assert max(moved) > 0.007


@pytest.mark.parametrize("name", ["pushrod-engine/intake", "pushrod-engine/lever", "direct-acting/finger"])
def test_rocker_valve_and_spring_move_together(name):
    """The rocker's end touches the valve at full lift; the lift compresses the spring against the ground."""
    structure = load_structure(name)
    motion, drawn = case_motion(structure, 100.0, count=360), build_mechanism(structure)
    (frame,), valve = drawn.levers.values(), drawn.valves[0]
    rocker, along = frame.rocker, drawn.valves[0].away
    lifts = [motion.instant(i).at(valve.point, along) @ along for i in range(360)]
    still, full = motion.instant(0), motion.instant(int(np.argmax(lifts)))
    path = structure.path(rocker) @ full.unknowns
    end = frame.space(frame.ends(path)[1]) @ along
    assert end == pytest.approx((valve.tip + full.at(valve.point, along)) @ along, abs=1e-9)
    driven = (frame.ends(path)[0] - frame.ends(0.0)[0]).imag
    moved = structure.row(rocker.start, rocker.direction) @ full.unknowns
    assert driven == pytest.approx(moved, rel=0.05 if rocker.finger else 1e-9)  # a finger's path is an arc
    before, after = (next(s for s in drawn.solids(one) if s.kind == "spring").points @ along for one in (still, full))
    assert after.max() == pytest.approx(before.max(), abs=1e-5)
    assert after.min() - before.min() == pytest.approx(max(lifts), abs=1e-4)


def test_scale_does_not_change_lift():
    """A mode vibrates about the installed mechanism; the scale changes the elastic part only."""
    structure = load_structure("pushrod-engine/intake")
    motion = case_motion(structure, 100.0)
    assert np.array_equal(motion.instant(80, 1000.0).unknowns, motion.instant(80).unknowns)
    shape = np.zeros(structure.dofs.size)
    shape[structure.dofs.names.index("cam.uy")] = -3.0
    swing = mode_motion(structure, shape)
    drawn = swing.instant(0).nodal[structure.model.mesh.node("cam"), 1]
    size = np.linalg.norm(np.ptp(structure.model.mesh.nodes, axis=0))
    assert drawn == pytest.approx(-0.05 * size)
    assert swing.instant(0, 2.0).unknowns == pytest.approx(2.0 * swing.instant(0).unknowns)
    assert swing.instant(12).unknowns == pytest.approx(-swing.instant(0).unknowns)


def test_colours_follow_points():
    """Values per point of the polylines: linear in between, exact at the ends of members."""
    structure = load_structure("pushrod-engine/intake")
    count = sum(len(line) for line in structure.model.mesh.lines.values())
    values = np.arange(count, dtype=float)
    instant = SceneState(structure, 0.0, np.zeros(structure.dofs.size), values)
    shaft, rod = (s for s in build_mechanism(structure).solids(instant) if s.kind in ("shaft", "member"))
    ends = len(structure.model.mesh.lines["camshaft"])
    assert (shaft.values.min(), shaft.values.max()) == (0.0, ends - 1.0)
    assert (rod.values.min(), rod.values.max()) == (float(ends), count - 1.0)
    top = shaft.points[shaft.values == 0.0]
    assert np.abs(top[:, 0]).max() < 1e-15  # the drive's end
