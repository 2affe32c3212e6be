"""Single faults: the report names key, line, given value, allowed values and remedy."""

# ruff: noqa: E501 - tables, a row to a line

import re

import pytest

from tests.errors.fault_helpers import LIBRARY_WORDS, is_at
from tests.thinning import mostly_slow

SPRING = '[springs.side]\nat = "cam"\ndirection = "{}"\nstiffness = "{}"\n[springs.valve]'

# fault: (old text, new text), the key that must be reported, a part of `given`, a part of the whole message
FAULTS = {
    # unknown keys, at every level
    "table": ("[masses]", "[mases]", "mases", "mases", "did you mean 'masses'"),
    "key at the top": ('title = "', 'titel = "', "titel", "titel", "did you mean 'title'"),
    "key of a member": ('camshaft = { nodes', 'camshaft = { element = 2, nodes', "members.camshaft.element", "element", "did you mean 'elements'"),
    "rate of a spring": ("stiffness =", "rate =", "springs.valve.rate", "rate", "did you mean 'stiffness'"),
    "key of a contact": ('follower = "tappet"', 'folower = "tappet"', "contacts.intake.folower", "folower", "did you mean 'follower'"),
    "key of the integrator": ('"newmark"', '"newmark", bta = 1', "run.integrator.bta", "bta", "did you mean 'beta'"),
    "key of another variant": ('"newmark"', '"newmark", rho_inf = 0.5', "run.integrator.rho_inf", "rho_inf", "method = 'generalized-alpha'"),
    "inner name of a cam's return": ("return =", "fall =", "cams.intake.fall", "fall", "return"),
    "inner name of a rocker's from": ("from =", "start =", "rockers.rocker.start", "start", "from"),
    "key without its table": ("format = 1\n", "format = 1\ncrank_speed = 500\n", "crank_speed", "crank_speed", "did you mean run.crank_speed?"),
    "node of a mass": ('at = "cam"', 'node = "cam"', "masses.lobe.node", "node", "did you mean 'at'?"),
    # missing keys
    "no format": ("format = 1\n", "", "format", "nothing", "add format = 1"),
    "no run": (re.compile(r"\[run\].*(?=\[output\])", re.S), "", "run", "nothing", "required"),
    "no Young's modulus": ('E = "207 GPa"\n', "", "materials.steel.E", "nothing", "Young's modulus"),
    "no shape": ('shape = "circle", ', "", "sections.shaft", "", "circle"),
    "no method": ('{ method = "newmark" }', "{ beta = 0.25 }", "run.integrator", "", "newmark"),
    "no nodes of a member": ('nodes = ["tappet", "pushrod-top"], ', "", "members.pushrod", "no nodes", "node"),
    # units
    "wrong unit": ('lift = "6 mm"', 'lift = "6 kg"', "cams.intake.lift", "6 kg", "Use a unit such as mm"),
    "unknown unit": ('"207 GPa"', '"207 Gpa"', "materials.steel.E", "207 Gpa", "did you mean 'GPa'"),
    "revolutions per minute without an angle": ('"3000 rpm"', '"3000 1/min"', "run.speed", "3000 1/min", "rpm"),
    "no number": ('lift = "6 mm"', 'lift = "six mm"', "cams.intake.lift", "six mm", "number"),
    "decimal comma": ('lift = "6 mm"', 'lift = "6,5 mm"', "cams.intake.lift", "6,5 mm", "'6.5 mm'"),
    "comma between thousands": ('lift = "6 mm"', 'lift = "1,500 mm"', "cams.intake.lift", "1,500 mm", "'1500 mm' if it separates thousands"),
    "range": ('lift = "6 mm"', 'lift = "6:7 mm"', "cams.intake.lift", "6:7 mm", "flexcam sweep runs a range"),
    "empty text": ('lift = "6 mm"', 'lift = ""', "cams.intake.lift", "''", "number"),
    "angle without unit": ('rise = "180 deg"', "rise = 180", "cams.intake", "deg", "'180 deg'"),
    "rotational stiffness along uy": ("[springs.valve]", SPRING.format("uy", "40 kN m/rad"), "springs.side.stiffness", "40 kN m/rad", "stiffness"),
    "stiffness about rx": ("[springs.valve]", SPRING.format("rx", "40 kN/m"), "springs.side.stiffness", "40 kN/m", "rotational stiffness"),
    "force with an angle": ('"40 kN/m"', '"40 kN deg/m"', "springs.valve.stiffness", "40 kN deg/m", "stiffness"),
    "unit of a pure number": ("nu = 0.29", 'nu = "0.29 mm"', "materials.steel.nu", "0.29 mm", "number"),
    # signs, zeros, values that are not finite, booleans instead of numbers
    "negative": ('lift = "6 mm"', 'lift = "-6 mm"', "cams.intake.lift", "-6 mm", "above zero"),
    "zero": ('diameter = "25 mm"', "diameter = 0", "sections.shaft.diameter", "0", "above zero"),
    "nan": ('lift = "6 mm"', "lift = nan", "cams.intake.lift", "nan", "finite"),
    "beyond doubles": ('lift = "6 mm"', 'lift = "1e400 mm"', "cams.intake.lift", "1e400", "between 1e-06 and 1e+08 mm"),
    "whole number beyond doubles": ('lift = "6 mm"', f"lift = 1{'0' * 400}", "cams.intake.lift", "10000", "between"),
    "true as a length": ('lift = "6 mm"', "lift = true", "cams.intake.lift", "true", "length"),
    "fraction as a count": ("steps_per_revolution = 720", "steps_per_revolution = 720.5", "run.steps_per_revolution", "720.5", ""),
    "zero steps": ("steps_per_revolution = 720", "steps_per_revolution = 0", "run.steps_per_revolution", "0", "1 or more"),
    "endless": ("revolutions = 1", "revolutions = 1e308", "run.revolutions", "1e+308", "revolutions"),
    "text as a switch": ("pushrod = { ", 'pushrod = { shear = "yes", ', "members.pushrod.shear", "'yes'", ""),
    "number as a switch": ("pushrod = { ", "pushrod = { shear = 1, ", "members.pushrod.shear", "1", ""),
    "truths as a direction": ('direction = "uy"', "direction = [false, true, false]", "springs.valve.direction", "true", "number"),
    "component of a probe": ('probes = ["valve", "cam"]', 'probes = ["valve.uy", "cam"]', "output.probes", "'valve.uy'", "every component"),
    "list in quotes": ('probes = ["valve", "cam"]', 'probes = "[valve, cam]"', "output.probes", "[valve, cam]", "quotes around each string"),
    "number as a table": ("revolutions = 1", "revolutions = 1\ndamping = 0.02", "run.damping", "0.02", "a table with keys among"),
    "radius of a circle": ('diameter = "25 mm"', 'radius = "12.5 mm"', "sections.shaft.radius", "radius", "twice the radius"),
    "text as a probe list": ('probes = ["valve", "cam"]', 'probes = "valve"', "output.probes", "'valve'", "list"),
    "date as a length": ('lift = "6 mm"', "lift = 2024-05-01", "cams.intake.lift", "2024", "length"),
    # ranges
    "Poisson's ratio": ("nu = 0.29", "nu = 0.6", "materials.steel.nu", "0.6", "0.5"),
    "tube without a wall": ('inner_diameter = "5 mm"', 'inner_diameter = "8 mm"', "sections.tube.inner_diameter", "8 mm", "below outer_diameter, 8 mm"),
    "event over 360 deg": ('rise = "180 deg"', 'rise = "200 deg"', "cams.intake", "380 deg", "360 deg"),
    "integrator out of range": ('{ method = "newmark" }', '{ method = "hht", alpha = 0.5 }', "run.integrator.alpha", "0.5", "-1/3"),
    "body without a shape": ('"0.15 kg"', '"0.15 kg", inertia = [1, 0, 0]', "masses.lobe.inertia", "1", "sum"),
    # references
    "material": ('material = "steel"', 'material = "stel"', "members.camshaft.material", "'stel'", "did you mean 'steel'"),
    "law": ('law = "shm"', 'law = "cycloid"', "cams.intake.law", "'cycloid'", "did you mean 'cycloidal'"),
    "point of a mass": ('lobe = { at = "cam"', 'lobe = { at = "camm"', "masses.lobe.at", "'camm'", "did you mean 'cam'"),
    "end of a spring": ('direction = "uy"', 'direction = "uy"\nto = "ground"', "springs.valve.to", "'ground'", "a point"),
    "point of a rocker": ('from = "pushrod-top"', 'from = "pushrod"', "rockers.rocker.from", "'pushrod'", "did you mean 'pushrod-top'"),
    "cam at a rocker's point": ('at = "cam"\nlaw', 'at = "valve"\nlaw', "cams.intake.at", "'valve'", "point"),
    "support": ("\nfront = [\"uy\"", "\nfrnt = [\"uy\"", "supports.frnt", "'frnt'", "did you mean 'front'"),
    "reaction of a free point": ("[output]", '[output]\nreactions = ["cam"]', "output.reactions", "'cam'", "a support of the case"),
    "reaction of a bearing": ("[output]", '[bearings]\nmiddle = { at = "cam", stiffness = "9 MN/m" }\n[output]\nreactions = ["cam"]', "output.reactions", "'cam'", "is no support"),
    "component held": ('tappet = ["ux", "uz", "ry"]', 'tappet = ["ux", "uz", "yr"]', "supports.tappet", "'yr'", "did you mean 'ry'"),
    "direction": ('direction = "uy"', 'direction = "uyy"', "springs.valve.direction", "'uyy'", "did you mean 'uy'"),
    "point of a rocker named like a node": ('to = "valve"', 'to = "cam"', "rockers.rocker.to", "'cam'", ""),
    "point of a rocker named like its start": ('to = "valve"', 'to = "pushrod-top"', "rockers.rocker.to", "'pushrod-top'", ""),
    "inertia at a rocker's point": ('valve = { at = "valve", mass = "0.10 kg" }', 'valve = { at = "valve", mass = "0.10 kg", inertia = [1e-5, 1e-5, 1e-5] }', "masses.valve", "", "inertia"),
    "offset at a rocker's point": ('valve = { at = "valve", mass = "0.10 kg" }', 'valve = { at = "valve", mass = "0.10 kg", offset = ["1 mm", 0, 0] }', "masses.valve", "", "offset"),
    "moment along a member": ("[springs.valve]", '[loads.twist]\nmember = "pushrod"\ndirection = "rx"\nforce_per_length = "5 N/m"\n[springs.valve]', "loads.twist.direction", "'rx'", "give moments at points"),
    "two signs": ('direction = "uy"', 'direction = "+-uy"', "springs.valve.direction", "'+-uy'", "uy"),
    "direction of length zero": ('direction = "uy"', "direction = [0, 0, 0]", "springs.valve.direction", "0", "zero"),
    "words as a direction": ('direction = "uy"', 'direction = ["a", "b", "c"]', "springs.valve.direction", "a", "three or six numbers"),
    "probe": ('probes = ["valve"', 'probes = ["vavle"', "output.probes", "'vavle'", "did you mean 'valve'"),
    "probe twice": ('probes = ["valve", "cam"]', 'probes = ["valve", "cam", "valve"]', "output.probes", '"valve"', "'valve'"),
    "node of a member": ('"cam", "rear"]', '"cam", "reer"]', "members.camshaft.nodes", "'reer'", "did you mean 'rear'"),
    "shape": ('shape = "circle"', 'shape = "cirle"', "sections.shaft", "'cirle'", "did you mean 'circle'"),
    "contact model": ('"published-load"', '"publshed-load"', "contacts.intake.model", "'publshed-load'", "did you mean 'published-load'"),
    "newer format": ("format = 1", "format = 2", "format", "2", "1"),
    # exclusive keys
    "neither mesh nor nodes": (re.compile(r"\[nodes\].*(?=\[materials)", re.S), "", "case file", "neither mesh nor nodes", "either mesh or"),
    "both mesh and nodes": ("[nodes]", 'mesh = "x.msh"\n[nodes]', "", "mesh and nodes", "either mesh or"),
    "both speeds": ("[run]", '[run]\ncrank_speed = "6000 rpm"', "run", "speed and crank_speed", "either speed or crank_speed"),
    "neither speed": ('speed = "3000 rpm"\n', "", "run", "neither speed nor crank_speed", "either speed or crank_speed"),
    "both steps": ("[run]", '[run]\nstep = "20 us"', "run", "steps_per_revolution and step", "either"),
    "steps too long for the method": ('{ method = "newmark" }', '{ method = "central-difference" }', "run.steps_per_revolution", "720, which is a step of", "times as many steps"),
    # types of tables
    "text for a section": ('{ shape = "circle", diameter = "25 mm" }', '"circle"', "sections.shaft", "'circle'", "table"),
    "list for a table": ("[materials.steel]", "[[materials.steel]]", "materials.steel", "[{", "table"),
    "table for a direction": ('direction = "uy"', "direction = { x = 1 }", "springs.valve.direction", "x", "uy"),
    "four coordinates": ('rear = ["180 mm", ', 'rear = ["180 mm", 0, ', "nodes.rear", "180 mm", "3"),
    # geometry
    "two nodes at one place": ('rear = ["180 mm"', 'rear = ["60 mm"', "nodes.rear", "front", "shared node"),
    "two nodes apart by rounding": ('rear = ["180 mm"', 'rear = ["60.00000001 mm"', "nodes.rear", "front", "shared node"),
    "custom section without shear factors": (re.compile(r'circle", diameter = "25 mm"(.*camshaft = { )', re.S), r'custom", A = 4e-4, Iy = 2e-8, Iz = 2e-8, J = 4e-8, kappa_y = 0.9\1shear = true, ', "sections.shaft.kappa_z", "nothing", "add kappa_z, such as"),
    "closed member": ('"cam", "rear"]', '"cam", "drive"]', "members.camshaft", "drive", "divide a closed member"),
    "node twice in a row": ('"cam", "rear"]', '"cam", "cam"]', "members.camshaft", "cam", ""),
    "wire without coils and mean diameter": ('stiffness = "40 kN/m"', 'stiffness = "40 kN/m"\nwire = { diameter = "4.6 mm" }', "springs.valve.wire.coil_diameter", "nothing", "The key is required unless the spring has the key coils."),
    "number as coils": ('stiffness = "40 kN/m"', "coils = 5", "springs.valve.coils", "5", "moving end. They replace stiffness and require wire."),
    "nothing resists the lift": ('stiffness = "40 kN/m"', "stiffness = 0", "contacts.intake.follower", "", "spring"),
}  # fmt: skip


def substitute_first(text, old, new):
    if isinstance(old, re.Pattern):
        assert old.search(text)
        return old.sub(new, text, count=1)
    assert old in text, f"{old!r} is not in the case"
    return text.replace(old, new, 1)


@pytest.mark.parametrize("name", mostly_slow(FAULTS, 2))
def test_fault_names_key_line_and_remedy(name, text, faults_of):
    old, new, key, given, said = FAULTS[name]
    bad = substitute_first(text, old, new)
    faults = faults_of(bad)
    found = [fault for fault in faults if is_at(fault.where, key)]
    assert found, f"no fault at {key}: {[str(f) for f in faults]}"
    assert any(given in f.given for f in found), [f.given for f in found]
    assert any(said in f"{f} {f.remedy}" for f in found), [str(f) for f in found]
    assert all(f.allowed for f in faults)
    assert not [str(f) for f in faults if any(word in str(f) for word in LIBRARY_WORDS)], (
        "the message contains words of a library"
    )
    if name not in WITHOUT_LINE:
        lines = [int(m[1]) for f in found if (m := re.search(r"\(line (\d+)", f.where))]
        assert lines, f"no line: {[f.where for f in found]}"
        assert not key or set(lines) & set(key_lines(bad, key)), f"lines {lines} are not those of {key}"
    if "did you mean" in said:
        assert any(said in f.remedy for f in found), "the suggestion is in the remedy"


def key_lines(text, key):
    """Return the lines that define the last part of a key path or one of its parent tables."""
    steps = re.split(r"\.(?![^\[]*\])", key)
    words = {re.escape(step) for step in steps}
    return [
        i
        for i, line in enumerate(text.splitlines(), 1)
        if any(re.match(rf"\s*(\[+[\w.-]*\b)?{w}\b", line) for w in words)
    ]


PROFILE = {
    "base_radius": 'base_radius = "24 mm"',
    "follower": 'follower = { type = "flat" }',
    "width": 'width = "12 mm"',
}
HERTZ = 'model = "unilateral"\nstiffness = "hertz"'


@pytest.mark.parametrize("missing", [["base_radius"], ["follower"], ["width"], ["base_radius", "width"], [*PROFILE]])
def test_hertz_contact_fault_names_missing_cam_keys(missing, text, substitute, faults_of):
    given = "\n".join(line for key, line in PROFILE.items() if key not in missing)
    (fault,) = faults_of(
        substitute(text, ('model = "published-load"', HERTZ), ("[cams.intake]", f"[cams.intake]\n{given}"))
    )
    assert fault.why == f"cams.intake has no {' and no '.join(missing)}"
    assert fault.remedy == f"add {' and '.join(missing)}, or write the stiffness as a number, such as '200 MN/m'"


WITHOUT_LINE = {"neither mesh nor nodes", "no format", "no run"}
"""Faults of keys that are missing in the file, so that there is no line to report."""


def test_modal_damping_of_large_model_suggests_rayleigh(text, substitute, faults_of):
    """Modal damping of more than 600 unknowns is refused; the message suggests alpha and beta."""
    fine = substitute(
        text, ('material = "steel", section = "shaft" }', 'material = "steel", section = "shaft", elements = 60 }'),
        ('start = "rest"', 'start = "rest"\ndamping = { modal = 0.02 }'),
    )  # fmt: skip
    (fault,) = faults_of(fine)
    assert fault.where.split(" ")[0] == "run.damping.modal"
    assert "unknowns" in fault.given
    assert "alpha" in fault.remedy
    assert "beta" in fault.remedy
