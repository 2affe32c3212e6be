"""Claims of Tayeb and Sliman about their valve train, compared with computed results."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flexcam.analysis.comparison import Comparison, compare
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import run
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.curves import parse_law
from flexcam.core.units import RPM
from flexcam.dynamics import floquet, reraise_interrupt
from flexcam.io import find_referenced_file, read_mesh
from flexcam.valvetrain import build_structure, model_modes

# deviation, relative to the lift, up to which a response counts as "very close" to the rigid one
_CLOSE_DEVIATION = 0.05


_PUBLISHED_LAWS = ("shm", "parabolic", "cycloidal")


@dataclass(frozen=True)
class Claim:
    """Claim of the paper and the computed result."""

    statement: str  #: claim as published
    reproduced: bool  #: whether the computation reproduces it
    finding: str  #: computed result in words


def deviation(case: Case, probe: str) -> Comparison:
    """Run a case flexible and rigid and compare the responses."""
    flexible = run(case)
    reraise_interrupt(flexible.status)
    return compare(flexible, run(case, rigid=True), probe, case.speed / RPM)


def check_claims(case: Case, probe: str, here: Comparison) -> list[Claim]:
    """Return the claims of the paper with the results of the case."""
    slow = deviation(case.at_speed(2000.0 * RPM), probe)
    laws: dict[str, Comparison] = {}
    for name in _PUBLISHED_LAWS:
        cams = {key: cam.model_copy(update={"law": parse_law(name)}) for key, cam in case.record.cams.items()}
        with_law = replace(case, record=case.record.model_copy(update={"cams": cams}))
        laws[name] = deviation(with_law, probe)
    largest = max(laws, key=lambda name: laws[name].peak_deviation)
    deviations = ", ".join(f"{name} {one.peak_deviation:.3f}" for name, one in laws.items())
    # The meshes of all three models in the folder of the case's mesh.
    folder = (find_referenced_file(case.path, case.record.mesh or "") or case.path).parent
    meshes = {f"model {k}": folder / f"tayeb-{k}.msh" for k in (1, 2, 3)}
    cases = {name: replace(case, mesh=read_mesh(path)) for name, path in meshes.items() if path.is_file()}
    others = {name: deviation(one, probe).peak_deviation for name, one in (cases or {"this model": case}).items()}
    models = ", ".join(f"{name} {value:.4f}" for name, value in others.items())
    spread = max(others.values()) - min(others.values())
    angle = here.deviations[0].angle_deg % 360.0
    off = (angle + 90.0) % 180.0 - 90.0
    where = f"it is largest at cam {angle:.1f} deg"
    return [
        _check_instability(case, probe),
        Claim(
            "at 2000 rpm and below very close to the rigid system",
            slow.peak_deviation < _CLOSE_DEVIATION,
            f"largest deviation / lift at 2000 rpm: {slow.peak_deviation:.3f}; very close: below {_CLOSE_DEVIATION}",
        ),
        Claim("SHM has the largest displacement", largest == "shm", f"largest deviation / lift: {deviations}"),
        Claim(
            "the response depends on the model's number of unknowns",
            spread > 0.01 * max(others.values()),
            f"largest deviation / lift: {models}; the pushrod is far stiffer than the spring",
        ),
        Claim("the deviation is largest at multiples of 180 deg", abs(off) < 1.0, where),
    ]


def _check_instability(case: Case, probe: str) -> Claim:
    """Distinguish an instability from growth over revolutions, which a beat also shows at first.

    The load moves the valve as ``x'' + w^2 x = w^2 (1 - cos W t)/2`` from rest, under simple harmonic motion of lift 1.
    With ``r = W/w`` it deviates from the lift by ``r^2/(1 - r^2) (cos w t - cos W t)/2``: the difference of two
    cosines of nearly equal frequency is a beat, bounded if r is not 1.
    """
    rpm, mode = 4000.0, 60.0 * excited_mode(case.at_speed(4000.0 * RPM))
    early, late = (deviation(case.at_speed(rpm * RPM, revolutions=n), probe).peak_deviation for n in (2.0, 4.0))
    multipliers = floquet(prepare(case.at_speed(rpm * RPM, revolutions=1.0)).problem)
    ratio = (rpm / mode) ** 2
    revolutions = rpm / abs(mode - rpm) if mode != rpm else math.inf
    bound = ratio / abs(1.0 - ratio) if mode != rpm else math.inf
    return Claim("unstable at 4000 rpm (SHM, parabolic)", not multipliers.stable(),
                 f"the deviation after 4 revolutions is {late / early:.2f} times that after 2, but disturbances do not "
                 f"grow: their largest multiplier is {abs(multipliers.multipliers[0]):.5g}; the follower's mass on its "
                 f"spring resonates at {mode:.0f} rpm. Near this speed an undamped motion beats: "
                 f"within {revolutions:.0f} revolutions the deviation grows to {bound:.0f} times the lift (SHM) and "
                 f"returns to zero")  # fmt: skip


def excited_mode(case: Case) -> float:
    """Return the frequency, Hz, of the mode nearest to the cam speed among those excited by the contact force."""
    structure = build_structure(build_model(case))
    found = model_modes(structure).modes
    contact = next(iter(structure.model.cam_contacts.values()))
    push = structure.row(contact.follower, contact.direction)
    driven = abs(push @ found.shapes)
    loaded = [f for f, part in zip(found.frequencies, driven, strict=True) if f > 0.0 and part > 1e-3 * driven.max()]
    return float(min(loaded, key=lambda f: abs(math.log(f * 2.0 * math.pi / case.speed))))
