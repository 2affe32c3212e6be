"""Faults in engine parts: levers, fingers, lash, adjusters, friction, impacts, bows, springs and speed fluctuation."""

# ruff: noqa: E501 - tables, a row to a line

import re
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, run
from tests.errors.fault_helpers import LIBRARY_WORDS, is_at
from tests.thinning import mostly_slow

ENGINE = Path(__file__).parents[1] / "data/every-engine.toml"

SWING = 'fluctuation = { orders = [2, 4], amplitudes = ["3 %", 0.01], phases = ["30 deg", 0] }'
FREE = 'free_running = { cam = "intake", cam_mass = "0.4 kg", follower_mass = "0.1 kg" }'
COILS = 'wire = { diameter = "4 mm", coil_diameter = "26 mm", active_coils = 3.5, shear_modulus = "80 GPa" }'
WIRE = 'wire = { diameter = "4 mm", coil_diameter = "26 mm" }'
NO_PROFILE = (
    'phase = "40 deg"\nbase_radius = "24 mm"\nfollower = { type = "flat" }\n\n[contacts.intake]',
    'phase = "40 deg"\n\n[contacts.intake]',
)
PERIODIC = ('start = "equilibrium"', 'start = "periodic"')
ANGLES = 'angles = ["-8 deg", "-6 deg"]'
ARMS = 'arms = ["25 mm", "40 mm"]'
ON_FINGER = '[contacts.second]\nat = "finger"\nmodel = "lash"\ngap = 0\nstiffness = 1e7\n\n[contacts.tip]'
AGAINST_LIFT = '[contacts.second]\nfrom = "valve"\nto = "stem"\ndirection = "-uy"\nmodel = "lash"\ngap = 0\nstiffness = 1e7\n\n[contacts.tip]'
OIL_ON_FINGER = '[contacts.second]\nat = "finger"\nmodel = "lash-adjuster"\nstiffness = 1e7\nleak = 1e5\nrefill = 200\nplunger_force = 20\n\n[contacts.tip]'
TWIST = '[springs.twist]\nat = "cam"\ndirection = "rx"\n{}\n\n[springs.tappet]'
STEM = 'stiffness = "40 kN/m"\ninstalled_force = "300 N"'
ROWS = 'force_table = [[0, 0], ["8 mm", "300 N"], ["20 mm", "900 N"]]'
UNEVEN = 'coils = [{ turns = 2, diameter = "24 mm", pitch = "5 mm" }, { turns = 4, diameter = "24 mm", pitch = "9 mm" }]\nwire = { diameter = "4 mm", shear_modulus = "80 GPa" }'
OTHER_FINGER = '[rockers.other]\nmodel = "lever"\nfrom = "pad"\nto = "twin"\ndirection = "uy"\narms = [0.02, 0.03]\ninertia = 1e-4\nstiffness = 1e6\n\n[springs.valve]'

# fault: changes, the key that must be reported, a part of `given`, a part of the whole message
FAULTS = {
    # members
    "bow without geometric stiffness": ([("geometric_stiffness = true\n", "")], "members.pushrod", "", "geometric_stiffness"),
    # levers
    "angles of a lumped rocker": ([('model = "lever"\nfrom = "top"', 'model = "lumped"\nfrom = "top"')], "rockers.rocker.angles", "angles", "Remove it"),
    "model of a rocker": ([('model = "lever"\nfrom = "top"', 'model = "levr"\nfrom = "top"')], "rockers.rocker.model", "'levr'", "Did you mean 'lever'"),
    "lever's lift exceeds its arm": ([(ARMS, 'arms = ["2.5 mm", "4 mm"]')], "rockers.rocker", "", ""),
    "lever installed along its motion": ([(ANGLES, 'angles = ["90 deg", "-6 deg"]')], "rockers.rocker.angles", "90 deg", "at most 75 deg from the perpendicular"),
    "lever's angle without its unit": ([(ANGLES, 'angles = [-8, "-6 deg"]')], "rockers.rocker.angles", "-458.366 deg", "in a case write '-8 deg'"),
    "lash behind a lever against its lift": ([("[contacts.tip]", AGAINST_LIFT)], "contacts.second.direction", "against the lift", "does not reverse the motion"),
    "lever installed backwards": ([(ANGLES, 'angles = ["200 deg", "-6 deg"]')], "rockers.rocker.angles", "200 deg", ""),
    "lever whose point stands along its motion": ([(ANGLES, 'angles = ["0 deg", "90 deg"]')], "rockers.rocker.angles", "90 deg", ""),
    "lever at a misspelt node, with a direction": ([('from = "top"', 'from = "tpo"\ndirection = "uy"')], "rockers.rocker.from", "'tpo'", "Did you mean 'top'"),
    "lever along a held direction": ([('from = "top"\n', 'from = "top"\ndirection = "ux"\n')], "rockers.rocker", "", ""),
    # finger followers
    "finger without direction": ([('to = "exhaust"\ndirection = "uy"', 'to = "exhaust"')], "rockers.finger", "nothing", 'direction = "uy"'),
    "finger that turns": ([('to = "exhaust"\ndirection = "uy"', 'to = "exhaust"\ndirection = "rx"')], "rockers.finger.direction", "rx", ""),
    "finger that nothing drives": ([('follower = "pad"', 'follower = "tappet"')], "rockers.finger", "", ""),
    "two fingers at one point": ([("[springs.valve]", OTHER_FINGER)], "rockers", "'pad'", "share a driven end"),
    "finger from its own point": ([('from = "pad"\nto = "exhaust"', 'from = "exhaust"\nto = "exhaust"')], "rockers.finger", "'exhaust'", "new name"),
    "support at a finger's point": ([('stem = ["ux"', 'pad = ["uy"]\nstem = ["ux"')], "supports.pad", "'pad'", "a point"),
    "follower of a finger misspelt": ([('follower = "pad"', 'follower = "pda"')], "contacts.exhaust.follower", "'pda'", "Did you mean 'pad'"),
    # friction and impacts
    "friction under a roller": ([('stiffness = "80 MN/m"\n', 'stiffness = "80 MN/m"\nfriction = 0.1\n')], "contacts.exhaust.friction", "0.1", "roller"),
    "friction without a profile": ([('stiffness = "40 MN/m"\n', 'stiffness = "40 MN/m"\nfriction = 0.1\n'), NO_PROFILE], "contacts.direct.friction", "0.1", "profile"),
    "friction of a bilateral contact": ([('model = "unilateral"\nstiffness = "40 MN/m"\ndissipation = "0.3 s/m"', 'model = "bilateral"\nstiffness = "40 MN/m"\nfriction = 0.1')], "contacts.direct.friction", "friction", "Remove it"),
    "breakaway force below the friction": ([("[output]", '[friction.guide]\nat = "stem"\ndirection = "uy"\nforce = "50 N"\nbreakaway_force = "8 N"\n[output]')], "friction.guide.breakaway_force", "8 N", "at least `force`, 50 N."),
    "damping of a cam contact": ([('stiffness = "40 MN/m"\ndissipation = "0.3 s/m"', 'stiffness = "40 MN/m"\ndamping = "0.3 s/m"')], "contacts.direct.damping", "damping", "Did you mean 'dissipation'?"),
    "friction speed without friction": ([("friction = 0.08\n", "")], "contacts.intake", "", "friction"),
    "restitution of a play": ([('gap = "0.05 mm"', 'gap = "0.05 mm"\nrestitution = 0.3')], "contacts.tip.restitution", "restitution", "Remove it"),
    "Hertz stiffness of a seat": ([('stiffness = "60 MN/m", damping = "100 N s/m" }\nstem', 'stiffness = "hertz" }\nstem')], "contacts.exhaust-seat.stiffness", "'hertz'", "only with model = 'unilateral'"),
    "restitution at a point without mass": ([('exhaust = { at = "exhaust", mass = "0.08 kg" }\n', ""), ('stiffness = "60 MN/m", damping = "100 N s/m" }\nstem', 'stiffness = "60 MN/m", restitution = 0.3 }\nstem')], "contacts.exhaust-seat", "restitution", "mass"),
    # plays
    "play at an unknown rocker": ([('at = "finger"', 'at = "fingr"')], "contacts.tip.at", "'fingr'", "Did you mean 'finger'"),
    "adjuster at an unknown rocker": ([('at = "rocker"', 'at = "rockr"')], "contacts.adjuster.at", "'rockr'", "Did you mean 'rocker'"),
    "adjuster at a node": ([('at = "rocker"', 'at = "tappet"')], "contacts.adjuster.at", "'tappet'", "a rocker"),
    "play from a node to itself": ([('from = "lifter-top"', 'from = "stem"')], "contacts.play", "stem", ""),
    "play to a rocker's point": ([('to = "stem"', 'to = "valve"')], "contacts.play.to", "'valve'", "at = 'rocker'"),
    "play at a rocker and between nodes": ([('from = "lifter-top"', 'at = "finger"\nfrom = "lifter-top"')], "contacts.play", "", "either at"),
    "play nowhere": ([('from = "lifter-top"\nto = "stem"\ndirection = "uy"\n', "")], "contacts.play", "", "either at"),
    "play without a direction": ([('to = "stem"\ndirection = "uy"', 'to = "stem"')], "contacts.play", "", "direction"),
    "play with an unknown direction": ([('to = "stem"\ndirection = "uy"', 'to = "stem"\ndirection = "uyy"')], "contacts.play.direction", "'uyy'", "Did you mean 'uy'"),
    "play about an axis": ([('to = "stem"\ndirection = "uy"', 'to = "stem-end"\ndirection = "rz"')], "contacts.play.gap", "0.1 mm", "unit of angle"),
    "gap negative": ([('gap = "0.1 mm"', 'gap = "-0.1 mm"')], "contacts.play.gap", "-0.1 mm", "zero or more"),
    "two plays at one rocker": ([("[contacts.tip]", ON_FINGER)], "contacts", "finger", ""),
    "play and adjuster at one rocker": ([("[contacts.tip]", OIL_ON_FINGER)], "contacts", "finger", ""),
    # adjusters
    "leak below refill": ([('leak = "100 kN s/m"', 'leak = "100 N s/m"')], "contacts.adjuster", "leak 100 N s/m", "resistance `leak` above the resistance `refill`"),
    "leak missing": ([('leak = "100 kN s/m"\n', "")], "contacts.adjuster", "stiffness = '15 MN/m'", "expected stiffness and leak, or oil"),
    "gap of an adjuster": ([('plunger_force = "20 N"', 'plunger_force = "20 N"\ngap = 0')], "contacts.adjuster.gap", "gap", "Remove it"),
    "model of an adjuster": ([('"lash-adjuster"', '"lash-adjustor"')], "contacts.adjuster.model", "'lash-adjustor'", "Did you mean 'lash-adjuster'"),
    # wire
    "coil too tight": ([(WIRE, 'wire = { diameter = "14 mm", coil_diameter = "26 mm" }')], "springs.exhaust.wire.coil_diameter", "26 mm", "twice the wire diameter"),
    "coils without a shear modulus": ([(WIRE, 'wire = { diameter = "4 mm", coil_diameter = "26 mm", active_coils = 4 }')], "springs.exhaust.wire", "4", "shear_modulus"),
    "no coil diameter": ([(WIRE, 'wire = { diameter = "4 mm" }')], "springs.exhaust.wire.coil_diameter", "nothing", "required"),
    "stiffness beside that of the wire": ([(COILS, f'stiffness = "50 kN/m"\n{COILS}')], "springs.valve", "", "stiffness"),
    "wire of a spring that twists": ([("[springs.tappet]", TWIST.format(COILS))], "springs.twist", "", ""),
    "clash of a spring without stiffness": ([(COILS, WIRE)], "springs.valve", "", "stiffness"),
    # nonlinear springs
    "stiffness beside a table": ([(STEM, f"{STEM}\n{ROWS}")], "springs.stem", "force_table, stiffness = '40 kN/m'", "either force_table or a stiffness"),
    "table with a force that falls": ([(STEM, ROWS.replace('"900 N"', '"250 N"'))], "springs.stem.force_table", "250 N", "increasing travel and force"),
    "table in one row": ([(STEM, "force_table = [[0, 0]]")], "springs.stem.force_table", "", "2"),
    "table that does not reach the installed force": ([(STEM, f'installed_force = "1 kN"\n{ROWS}')], "springs.stem.force_table", "", "covers the installed_force, 1000 N. Its forces reach from 0 to 900 N"),
    "table beside coils": ([(STEM, f"{ROWS}\n{UNEVEN}")], "springs.stem", "", "either force_table or coils"),
    "table of a spring that pulsates": ([(STEM, f"{ROWS}\npulsation = {{ order = 1, amplitude = 0.1 }}")], "springs.stem", "", "without pulsation"),
    "table of a spring that twists": ([("[springs.tappet]", TWIST.format(ROWS))], "springs.twist", "", "along a line"),
    "force and compression": ([(STEM, f'installed_force = 300\ninstalled_compression = "8 mm"\n{ROWS}')], "springs.stem", "", "either installed_force"),
    "coils without a wire": ([(STEM, UNEVEN.partition("wire")[0])], "springs.stem", "", "shear_modulus with coils"),
    "coils and a coil diameter": ([(STEM, UNEVEN.replace("shear", 'coil_diameter = "24 mm", shear'))], "springs.stem", "", "coil_diameter"),
    "coils and a travel": ([(STEM, f'{UNEVEN}\nclash_travel = "9 mm"')], "springs.stem", "coils, clash_travel = '9 mm', wire", "without clash_travel"),
    "coils with two masses": ([(STEM, f'{UNEVEN}\nmass = "50 g"'.replace("shear", "density = 7850, shear"))], "springs.stem", "", "mass or a density"),
    "coils of a pitch within the wire": ([(STEM, UNEVEN.replace("9 mm", "3.9 mm"))], "springs.stem.coils.1.pitch", "3.9 mm", "above 4 mm"),
    "coils too tight": ([(STEM, UNEVEN.replace("24 mm", "7 mm"))], "springs.stem.coils.0.diameter", "7 mm", "twice the diameter"),
    "coils installed solid": ([(STEM, f'{UNEVEN}\ninstalled_force = "5 kN"')], "springs.stem", "", "before all coils touch"),
    "density of a uniform wire": ([(WIRE, WIRE.replace(" }", ", density = 7850 }"))], "springs.exhaust", "", "only with coils"),
    "shear modulus without coils": ([(WIRE, WIRE.replace(" }", ', shear_modulus = "80 GPa" }'))], "springs.exhaust", "", "active_coils"),
    # speed
    "fewer amplitudes than orders": ([('["3 %", 0.01]', '["3 %"]')], "run.fluctuation", "3 %", "as many amplitudes as orders"),
    "fewer phases than orders": ([('["30 deg", 0]', '["30 deg"]')], "run.fluctuation", "", "as many phases"),
    "no orders": ([(SWING, "fluctuation = { orders = [], amplitudes = [] }")], "run.fluctuation.orders", "[]", "1"),
    "amplitudes that stop the shaft": ([('["3 %", 0.01]', '["60 %", 0.4]')], "run.fluctuation", "60 %", "below 1"),
    "two ways to turn": ([(SWING, f"{SWING}\n{FREE}")], "run", "", "one of fluctuation, free_running"),
    "free running with an unknown cam": ([(SWING, FREE.replace('"intake"', '"intak"'))], "run.free_running.cam", "'intak'", "Did you mean 'intake'"),
    "free running without a base circle": ([(SWING, FREE.replace('"intake"', '"direct"')), NO_PROFILE], "cams.direct", "", "base_radius"),
    # start
    "periodic with half an order": ([PERIODIC, ("orders = [2, 4]", "orders = [0.5, 4]")], "run", "", "whole orders"),
    "periodic with a step that does not fit": ([PERIODIC, ("steps_per_revolution = 720", 'step = "31 us"')], "run.step", "3.1e-05 s", "whole number of steps"),
}  # fmt: skip


@pytest.fixture(scope="module")
def engine_text():
    return ENGINE.read_text(encoding="utf-8")


@pytest.fixture
def write_case(engine_text, substitute, tmp_path):
    """Return a function that writes the case file with changes."""

    def write(changes):
        path = tmp_path / "case.toml"
        path.write_text(substitute(engine_text, *changes), encoding="utf-8")
        return path

    return write


def find_faults(path):
    try:
        prepare(read_case(path))
    except InputError as refusal:
        return refusal.faults
    pytest.fail("accepted")


@pytest.mark.parametrize("name", mostly_slow(FAULTS))
def test_fault_names_key_line_and_remedy(name, write_case):
    changes, key, given, said = FAULTS[name]
    faults = find_faults(write_case(changes))
    found = [fault for fault in faults if is_at(fault.where, key)]
    assert found, f"no fault at {key}: {[str(f) for f in faults]}"
    assert any(given in f.given and said in str(f) for f in found), [str(f) for f in found]
    assert any(re.search(r"\(line \d+", f.where) for f in found), "the line of the file"
    assert all(f.allowed for f in faults)
    assert not [str(f) for f in faults if any(word in str(f) for word in LIBRARY_WORDS)]


@pytest.mark.parametrize(("verb", "name"), [(verb, name) for verb in ("check", "run") for name in list(FAULTS)[::60]])
def test_fault_gives_exit_code_2_without_traceback(verb, name, write_case, flexcam, tmp_path):
    write_case(FAULTS[name][0])
    assert flexcam(verb, "case.toml").code == 2
    assert not list(tmp_path.glob("results/*")), "no result of a refused case"


# changes, and the key paths that the report must contain
MANY = {
    "a key of every part": (
        [('bow = "0.3 mm"', "bow = nan"), ('drive_stiffness = "8 MN/m"', 'drive_stiffness = "8 MN"'), ("friction = 0.08", "friction = -1"),
         ("restitution = 0.3", "restitution = 2"), ('leak = "100 kN s/m"', 'leak = "100 N s/m"'), ('gap = "0.1 mm"', "gap = -1"),
         ("3.5", "-3.5"), ('["3 %", 0.01]', '["3 %"]'), ('start = "equilibrium"', 'start = "periodical"')],
        ["members.pushrod.bow", "rockers.rocker.drive_stiffness", "contacts.intake.friction", "contacts.seat.restitution", "contacts.adjuster",
         "contacts.play.gap", "springs.valve.wire.active_coils", "run.fluctuation", "run.start"],
    ),
    "names": (
        [('at = "finger"', 'at = "fingr"'), ('at = "rocker"', 'at = "rockr"'), ('from = "lifter-top"', 'from = "lifter-tp"'),
         ('to = "stem"', 'to = "stm"'), ('follower = "pad"', 'follower = "pda"')],
        ["contacts.tip.at", "contacts.adjuster.at", "contacts.play.from", "contacts.play.to", "contacts.exhaust.follower"],
    ),
    "names beside values": (
        [('at = "finger"', 'at = "fingr"'), ('leak = "100 kN s/m"', 'leak = "100 N s/m"'), ("geometric_stiffness = true\n", ""), (WIRE, WIRE.replace('"4 mm"', '"14 mm"')), (SWING, f"{SWING}\n{FREE}")],
        ["contacts.tip.at", "contacts.adjuster", "members.pushrod", "springs.exhaust.wire", "run"],
    ),
    "parts that do not fit": (
        [('stiffness = "80 MN/m"\n', 'stiffness = "80 MN/m"\nfriction = 0.1\n'), ('stiffness = "40 MN/m"\n', 'stiffness = "40 MN/m"\nfriction = 0.1\n'), NO_PROFILE],
        ["contacts.exhaust.friction", "contacts.direct.friction"],
    ),
    "a cam of the run beside a name": (
        [(SWING, FREE.replace('"intake"', '"intak"')), ('at = "finger"', 'at = "fingr"')], ["run.free_running.cam", "contacts.tip.at"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MANY)
def test_report_contains_all_faults(name, write_case):
    changes, keys = MANY[name]
    wheres = [fault.where for fault in find_faults(write_case(changes))]
    lacking = [key for key in keys if not any(where.startswith(key) for where in wheres)]
    assert not lacking, f"reported: {wheres}"
    assert len(wheres) == len(set(wheres))


@pytest.mark.parametrize("angles", [ANGLES, 'angles = ["-60 deg", "-6 deg"]'])
def test_rigid_model_with_lever_is_finite(angles, write_case):
    response = run(read_case(write_case([(ANGLES, angles)])), rigid=True)
    assert np.isfinite(response["valve"].displacement).all()


@pytest.mark.parametrize(
    "change",
    [(ARMS, 'arms = ["2.5 mm", "4 mm"]'), (ANGLES, 'angles = ["76 deg", "-6 deg"]'), (ANGLES, 'angles = ["90 deg", 0]')],
)  # fmt: skip
def test_rigid_model_with_infeasible_lever_is_refused(change, write_case):
    with pytest.raises(InputError, match=r"rockers\.rocker"):
        run(read_case(write_case([change])), rigid=True)
