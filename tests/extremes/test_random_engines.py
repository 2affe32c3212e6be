"""Random but feasible engines: each run is complete, or its status names the cause."""

import numpy as np
import pytest

from flexcam import read_case, run
from flexcam.dynamics import RunFailedError
from tests.thinning import mostly_slow

HEAD = """
format = 1

[nodes]
drive = [0, 0, 0]
cam = ["60 mm", 0, 0]
rear = ["120 mm", 0, 0]
tappet = ["60 mm", "28 mm", 0]
top = ["60 mm", "278 mm", 0]

[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"

[sections]
shaft = {{ shape = "circle", diameter = "30 mm" }}
tube = {{ shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }}

[members]
camshaft = {{ nodes = ["drive", "cam", "rear"], material = "steel", section = "shaft" }}
{pushrod}

[supports]
drive = ["ux", "uy", "uz", "rx"]
rear = ["uy", "uz"]
tappet = ["ux", "uz", "ry", "rx"]
top = ["ux", "uz"]

[masses]
follower = {{ at = "{follower}", mass = {follower_mass} }}
valve = {{ at = "valve", mass = {valve_mass} }}

[rockers.rocker]
{rocker}

[springs.valve]
at = "valve"
direction = "uy"
{spring}

[springs.tappet]
at = "tappet"
direction = "uy"
stiffness = "0.5 kN/m"
installed_force = "10 N"

[cams.intake]
at = "cam"
law = "{law}"
lift = {lift}
rise = "80 deg"
return = "80 deg"
phase = "30 deg"
{ramps}
base_radius = "{base} mm"
width = "12 mm"
follower = {face}

[contacts.intake]
cam = "intake"
follower = "{follower}"
model = "unilateral"
{contact}

[contacts.seat]
at = "valve"
model = "seat"
{seat}

{play}

[run]
crank_speed = "{speed} rpm"
revolutions = 1
steps_per_revolution = {steps}
start = "{start}"
{drive}
damping = {{ beta = "1e-7 s" }}

[output]
probes = ["valve", "cam", "tappet"]
"""


class Draw:
    """Random numbers of one seed."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.number = self.random.uniform

    def about(self, value):
        """Return a random value within three decades around the given one."""
        return float(value * 10.0 ** self.number(-1.5, 1.5))

    def maybe(self, text, chance=0.5):
        return text if self.random.random() < chance else ""

    def one_of(self, *choices):
        return choices[int(self.random.integers(len(choices)))]


def pushrod(draw):
    bent = "geometric_stiffness = true"
    bow = f"{bent}, bow = {draw.number(-1.0, 1.0) * 1e-3}"
    what = draw.one_of("", f", {bent}", f", {bow}")
    elements = draw.one_of(1, 2, 3)
    return (
        f'pushrod = {{ nodes = ["tappet", "top"], elements = {elements}, material = "steel", section = "tube"{what} }}'
    )


def rocker(draw, kind):
    arms = f'arms = ["25 mm", "{draw.number(20.0, 45.0)} mm"]'
    inertia = f"inertia = {draw.about(6e-5)}"
    if kind == "lumped":
        return f'model = "lumped"\nfrom = "top"\nto = "valve"\n{arms}\n{inertia}'
    start = 'from = "pad"\ndirection = "uy"' if kind == "finger" else 'from = "top"'
    angles = f"angles = [{draw.number(-0.3, 0.1)}, {draw.number(-0.4, 0.2)}]"
    driven = draw.maybe(f"drive_stiffness = {draw.about(2e7)}\ndrive_damping = {draw.about(50.0)}")
    own = f"stiffness = {draw.about(1e7)}\ndamping = {draw.about(50.0)}"
    return f'model = "lever"\n{start}\nto = "valve"\n{arms}\n{angles}\n{inertia}\n{own}\n{driven}'


def spring(draw):
    elements = draw.one_of(1, 2, 5, 9)
    stiffness = f"stiffness = {draw.about(50e3)}"
    coils = (
        f'wire = {{ diameter = "4 mm", coil_diameter = "26 mm", active_coils = {draw.number(2.5, 8.0)}, '
        'shear_modulus = "80 GPa" }'
    )
    lines = (
        draw.one_of(stiffness, coils), f"installed_force = {draw.about(400.0)}", f"mass = {draw.about(0.06)}",
        f"elements = {elements}", f"damping = {draw.about(2.0)}", draw.maybe('clash_travel = "15 mm"'),
    )  # fmt: skip
    return "\n".join(lines)


def make_lash(draw):
    lash = f'model = "lash"\ngap = {draw.number(0.0, 0.5) * 1e-3}\nstiffness = {draw.about(2e7)}'
    lash += f"\ndamping = {draw.about(200.0)}"
    refill = draw.about(300.0)
    oil = f'model = "lash-adjuster"\nstiffness = {draw.about(2e7)}\nleak = {refill * 10.0 ** draw.number(0.5, 4.0)}'
    oil += f"\nrefill = {refill}\nplunger_force = {draw.about(20.0)}"
    one = draw.one_of("", lash, oil)
    return f'[contacts.play]\nat = "rocker"\n{one}' if one else ""


def engine(seed):
    """Return the text of a random case."""
    draw = Draw(seed)
    kind = draw.one_of("lumped", "lever", "finger")
    rolls = draw.random.random() < 0.3
    hertz = draw.random.random() < 0.5
    face = '{ type = "roller", radius = "9 mm" }' if rolls else '{ type = "flat" }'
    contact = [
        'stiffness = "hertz"' if hertz else f"stiffness = {draw.about(5e7)}",
        f"dissipation = {draw.number(0.0, 0.5)}",
        draw.maybe(f"restitution = {draw.number(0.0, 0.95)}", 0.4),
    ]
    if not rolls:
        contact.append(draw.maybe(f"friction = {draw.number(0.0, 0.3)}\nfriction_speed = {draw.about(0.02)}"))
    seat = f"stiffness = {draw.about(6e7)}\ndamping = {draw.about(300.0)}\n"
    swing = f"fluctuation = {{ orders = [2], amplitudes = [{draw.number(0.0, 0.1)}] }}"
    return HEAD.format(
        pushrod=pushrod(draw),
        follower="pad" if kind == "finger" else "tappet",
        follower_mass=draw.about(0.06), valve_mass=draw.about(0.09),
        rocker=rocker(draw, kind), spring=spring(draw), law=draw.one_of("4-5-6-7", "cycloidal", "modified-sine"),
        lift=6e-3 * draw.number(0.4, 1.2), base=draw.number(35.0, 45.0), face=face, contact="\n".join(contact),
        ramps=draw.maybe('ramps = { height = "0.3 mm", duration = "25 deg" }'),
        seat=seat + draw.maybe(f"restitution = {draw.number(0.0, 0.9)}", 0.4), play=make_lash(draw),
        speed=draw.about(4000.0), steps=draw.one_of(360, 720), start=draw.one_of("rest", "equilibrium"),
        drive=draw.maybe(swing, 0.3),
    )  # fmt: skip


def run_engine(seed, folder):
    """Return the status and the energy residual relative to the energy of the run.

    The energy balance is not checked if a step covers several periods of the accelerations.
    `flexcam run` warns of such steps and of the residual.
    """
    path = folder / f"engine-{seed}.toml"
    path.write_text(engine(seed), encoding="utf-8")
    try:
        response = run(read_case(path))
    except RunFailedError as failure:
        return failure.status, 0.0
    for values in (*response.channels.values(), response.probes.displacement, response.fields.displacement):
        assert np.isfinite(values).all()
    energy = {name.partition(".")[2]: v for name, v in response.channels.items() if name.startswith("energy.")}
    fields, step = response.fields, response.time[1] - response.time[0]
    if np.sqrt((fields.acceleration**2).sum()) * step > 6.0 * np.pi * np.sqrt((fields.velocity**2).sum()):
        return response.status, 0.0
    most = max(np.abs(energy["work"]).max(), (energy["kinetic"] + energy["strain"] + energy["contact"]).max())
    return response.status, float(np.abs(energy["residual"]).max() / most) if most > 0.0 else 0.0


QUICK = (161, 150, 3, 13, 14, 17, 38, 39, 43, 44, 45, 111, 121, 162, 185, 213, 264)


def check_engine(seed, folder):
    status, residual = run_engine(seed, folder)
    assert status.ok or (len(status.text) > 20 and status.remedy), str(status)
    assert not status.ok or residual < 0.02, f"{residual:.2g} of the energy is the residual"


@pytest.mark.parametrize("seed", mostly_slow(QUICK))
def test_selected_random_engines_complete_or_name_cause(seed, tmp_path):
    check_engine(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(300))
def test_300_random_engines_complete_or_name_cause(seed, tmp_path):
    check_engine(seed, tmp_path)
