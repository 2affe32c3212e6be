"""All TOML blocks of documents are valid TOML, and those that are complete cases run."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

from flexcam import read_case, run

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```toml\n(.*?)^```", re.S | re.M)
DIRECTIVE = re.compile(r"^\.\. code-block:: toml\n\n((?:(?: {3,}.*)?\n)+)", re.M)
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.rst")]


def blocks(path):
    text = path.read_text(encoding="utf-8")
    plain = [re.sub(r"^ {3,4}", "", block, flags=re.M) for block in DIRECTIVE.findall(text)]
    return [*FENCE.findall(text), *plain]


ALL = [pytest.param(b, id=f"{p.relative_to(ROOT)}-{i}") for p in sorted(DOCUMENTS) for i, b in enumerate(blocks(p), 1)]


@pytest.fixture
def write_case(tmp_path):
    """Return a function that writes a case two folders below one that contains the meshes."""
    (tmp_path / "meshes").symlink_to(ROOT / "meshes")
    folder = tmp_path / "cases/documents"
    folder.mkdir(parents=True)

    def write(text):
        (folder / "case.toml").write_text(text, encoding="utf-8")
        return folder / "case.toml"

    return write


@pytest.mark.parametrize("block", ALL)
def test_toml_block_of_document_is_valid(block, write_case):
    content = tomllib.loads(block)
    if "format" in content:
        assert run(read_case(write_case(block))).status.ok


REFERENCE_CASE = """
format = 1
title = "Published model 3, simple harmonic motion"
mesh = "../../meshes/tayeb-3.msh"       # or [nodes] and members.NAME.nodes, never both

[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"

[sections]
shaft = { shape = "circle", diameter = "25 mm" }
tube = { shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }

[members]                               # names are the mesh's line groups
camshaft = { material = "steel", section = "shaft" }
pushrod = { material = "steel", section = "tube" }

[supports]                              # point group = components held
drive = ["uy", "uz", "rx"]
bearings = ["uy", "uz"]
guide = ["ux", "uz", "rx", "ry", "rz"]  # pushrod top and interior
tappet = ["ux", "uz", "ry"]

[masses]
lobe = { at = "cam", mass = "0.15 kg" }
follower = { at = "tappet", mass = "0.10 kg" }
valve = { at = "valve", mass = "0.10 kg" }

[rockers.rocker]                        # defines the point "valve"
model = "lumped"                        # M_eq, K_eq at the pushrod; or "lever"
from = "pushrod-top"
to = "valve"
arms = ["25 mm", "40 mm"]
inertia = "1e-4 kg m^2"

[springs]
valve = { at = "valve", direction = "uy", stiffness = "40 kN/m" }

[cams.intake]
at = "cam"
law = "shm"
lift = "6 mm"
rise = "180 deg"
return = "180 deg"                      # dwell and phase default to 0

[contacts.intake]
cam = "intake"
follower = "tappet"
model = "published-load"                # bilateral | unilateral

[run]
speed = "3000 rpm"
revolutions = 2
steps_per_revolution = 3600
start = "rest"                          # equilibrium | periodic
integrator = { method = "newmark" }     # hht | generalized-alpha | ...

[output]
probes = ["valve", "cam"]
field_every = 20
"""


def test_reference_case_runs(write_case):
    case = read_case(write_case(REFERENCE_CASE))
    response = run(case)
    assert response.status.ok
    assert (len(response.outline.unknowns), response.stats.unknowns, response.stats.steps) == (47, 24, 7200)


def test_dwell_and_phase_default_to_zero(write_case):
    cam = read_case(write_case(REFERENCE_CASE)).record.cams["intake"]
    assert (cam.dwell, cam.phase) == (0.0, 0.0)


def test_step_in_seconds_replaces_steps_per_revolution(write_case):
    case = read_case(write_case(REFERENCE_CASE.replace("steps_per_revolution = 3600", 'step = "20 us"')))
    assert run(case).stats.steps == 2000


def test_page_of_the_case_format_is_up_to_date():
    made = runpy.run_path(str(ROOT / "docs/make_case_format.py"))["page"]()
    assert (ROOT / "docs/case-format.md").read_text(encoding="utf-8") == made, "run make docs-pages"
