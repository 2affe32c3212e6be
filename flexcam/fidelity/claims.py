"""What the paper of Tayeb and Sliman says, held against what its own model computes: in words, with numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flexcam.case import Case, build_model, given_law
from flexcam.fidelity.beat import beat
from flexcam.fidelity.compare import Comparison, compare
from flexcam.integrate import floquet
from flexcam.io import file_beside, read_mesh
from flexcam.response import heed
from flexcam.runner import prepare, run
from flexcam.train import build_structure, model_modes
from flexcam.units import RPM

_CLOSE = 0.05
"""Deviation, as a fraction of the lift, up to which a response counts as "very close" to the rigid one."""


_THEIR_LAWS = ("shm", "parabolic", "cycloidal")


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and what the computation says to it.

    Parameters
    ----------
    statement
        What the paper says.
    reproduced
        Whether this model shows it.
    finding
        What was computed.
    """

    statement: str
    reproduced: bool
    finding: str


def loaded_mode(case: Case) -> tuple[float, float]:
    """Return the mode nearest the cam speed among those the contact force drives."""
    structure = build_structure(build_model(case))
    found = model_modes(structure).modes
    contact = next(iter(structure.model.driven.values()))
    push = structure.row(contact.follower, contact.direction)
    driven = abs(push @ found.shapes)
    loaded = [f for f, part in zip(found.frequencies, driven, strict=True) if f > 0.0 and part > 1e-3 * driven.max()]
    nearest = min(loaded, key=lambda f: abs(math.log(f * 2.0 * math.pi / case.speed)))
    return float(nearest), float(nearest) * 60.0


def deviation(case: Case, probe: str) -> Comparison:
    """Run a case flexible and rigid and compare them."""
    flexible = run(case)
    heed(flexible.status)
    return compare(flexible, run(case, rigid=True), probe, case.speed / RPM)


def claims(case: Case, probe: str, here: Comparison) -> list[Claim]:
    """Return the paper's claims beside what the case's data give."""
    slow = deviation(case.at_speed(2000.0 * RPM), probe)
    laws = {name: deviation(_with_law(case, name), probe) for name in _THEIR_LAWS}
    largest = max(laws, key=lambda name: laws[name].peak_deviation)
    told = ", ".join(f"{name} {one.peak_deviation:.3f}" for name, one in laws.items())
    others = _other_models(case, probe)
    spread = max(others.values()) - min(others.values())
    off = (here.deviations[0].angle_deg + 90.0) % 180.0 - 90.0
    return [
        _unstable(case, probe),
        Claim("at 2000 rpm and below very close to the rigid system", slow.peak_deviation < _CLOSE,
              f"the deviation at 2000 rpm is {slow.peak_deviation:.3f} of the lift (very close: below {_CLOSE})"),
        Claim("SHM has the largest displacement", largest == "shm", f"peak deviation of the lift: {told}"),
        Claim("the response depends on the model's number of unknowns", spread > 0.01 * max(others.values()),
              "peak deviation " + ", ".join(f"{name} {value:.4f}" for name, value in others.items())
              + ": the pushrod is far stiffer than the spring"),
        Claim("the deviation is largest at multiples of 180 deg", abs(off) < 1.0,
              f"it is largest at {here.deviations[0].angle_deg:.1f} deg"),
    ]  # fmt: skip


def _unstable(case: Case, probe: str) -> Claim:
    """Tell growth from revolution to revolution, which a beat has at first, from an instability."""
    rpm, (_, mode) = 4000.0, loaded_mode(case.at_speed(4000.0 * RPM))
    early, late = (deviation(case.at_speed(rpm * RPM, revolutions=n), probe).peak_deviation for n in (2.0, 4.0))
    multipliers = floquet(prepare(case.at_speed(rpm * RPM, revolutions=1.0)).problem)
    revolutions, bound = beat(rpm, mode)
    return Claim("unstable at 4000 rpm (SHM, parabolic)", not multipliers.stable(),
                 f"from 2 to 4 revolutions the deviation grows {late / early:.2f} times, but disturbances do not: "
                 f"their largest multiplier is {abs(multipliers.multipliers[0]):.5g}; the follower's mass on its "
                 f"spring resonates at {mode:.0f} rpm, and beside it an undamped motion beats: within "
                 f"{revolutions:.0f} revolutions up to {bound:.0f} of the lift (SHM) and back")  # fmt: skip


def _with_law(case: Case, law: str) -> Case:
    cams = {name: cam.model_copy(update={"law": given_law(law)}) for name, cam in case.record.cams.items()}
    return replace(case, record=case.record.model_copy(update={"cams": cams}))


def _other_models(case: Case, probe: str) -> dict[str, float]:
    """Return the peak deviation on the meshes of all three models, which lie beside the case's own."""
    folder = (file_beside(case.path, case.record.mesh or "") or case.path).parent
    meshes = {f"model {k}": folder / f"tayeb-{k}.msh" for k in (1, 2, 3)}
    found = {name: replace(case, mesh=read_mesh(path)) for name, path in meshes.items() if path.is_file()}
    return {name: deviation(other, probe).peak_deviation for name, other in (found or {"this model": case}).items()}
