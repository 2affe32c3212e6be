"""Several faults in one file come in one report, whatever they are about."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

import pytest

# changes, and the key paths of which each must have its fault in the one report
MANY = {
    "keys, units, names": (
        [("density =", "densty ="), ('"207 GPa"', '"207 Gpa"'), ('law = "shm"', 'law = "cosine"'), ("revolutions =", "revolution =")],
        ["materials.steel.densty", "materials.steel.density", "materials.steel.E", "cams.intake.law", "run.revolution"],
    ),
    "every table": (
        [("nu = 0.29", "nu = true"), ('diameter = "25 mm"', "diameter = -1"), ('section = "tube"', 'section = "tub"'),
         ('"0.15 kg"', '"0.15 mm"'), ("inertia =", "inerta ="), ('"40 kN/m"', '"40 kN"'), ('lift = "6 mm"', "lift = nan"),
         ('cam = "intake"', 'cam = "exhaust"'), ('"3000 rpm"', '"0 rpm"'), ("field_every = 20", "field_every = 0")],
        ["materials.steel.nu", "sections.shaft.diameter", "members.pushrod.section", "masses.lobe.mass", "rockers.rocker.inerta",
         "springs.valve.stiffness", "cams.intake.lift", "contacts.intake.cam", "run.speed", "output.field_every"],
    ),
    "geometry beside keys": (
        [("density =", "densty ="), ('rise = "180 deg"', 'rise = "200 deg"')], ["materials.steel.densty", "cams.intake"],
    ),
    "ranges in several parts": (
        [('inner_diameter = "5 mm"', 'inner_diameter = "9 mm"'), ('rise = "180 deg"', 'rise = "200 deg"'), ("nu = 0.29", "nu = 0.6"),
         ('"0.15 kg"', '"0.15 kg", inertia = [1, 0, 0]')],
        ["sections.tube", "cams.intake", "materials.steel", "masses.lobe"],
    ),
    "integrator beside references": (
        [('{ method = "newmark" }', '{ method = "hht", alpha = 3 }'), ('probes = ["valve"', 'probes = ["vale"')],
        ["run.integrator", "output.probes"],
    ),
    "table as text": (
        [('title = "Nodes in the file"', 'title = "x"\nmasses = "none"\nspringz = 3'),
         ('[masses]\nlobe = { at = "cam", mass = "0.15 kg" }\nfollower = { at = "tappet", mass = "0.10 kg" }\n', ""),
         ('valve = { at = "valve", mass = "0.10 kg" }\n', "")],
        ["masses", "springz"],
    ),
    "exclusive keys beside units": (
        [("[run]", '[run]\ncrank_speed = "6000 rpm"'), ('lift = "6 mm"', 'lift = "6 kg"')], ["run", "cams.intake.lift"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MANY)
def test_all_faults_in_one_report(name, text, changed, faults_of):
    changes, keys = MANY[name]
    wheres = [fault.where for fault in faults_of(changed(text, *changes))]
    lacking = [key for key in keys if not any(where.startswith(key) for where in wheres)]
    assert not lacking, f"reported: {wheres}"


def test_no_place_is_reported_twice(text, changed, faults_of):
    changes, _ = MANY["every table"]
    told = [(fault.where, fault.given) for fault in faults_of(changed(text, *changes))]
    assert len(told) == len(set(told))


def test_the_report_names_each_on_a_line_of_its_own(text, changed, faults_of, tmp_path):
    changes, keys = MANY["every table"]
    faults = faults_of(changed(text, *changes))
    assert len("\n".join(map(str, faults)).splitlines()) == len(faults) >= len(keys)
