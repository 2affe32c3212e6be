"""Valve spring settings of a case by the closed form of Petrescu."""

from __future__ import annotations

from collections.abc import Mapping

from flexcam.analysis.petrescu import Setting, SingleMassModel, evaluate_setting
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core.errors import refuse
from flexcam.dynamics import AngleFunction, constant
from flexcam.valvetrain import Cam, CamContact, Model, Spring, build_structure, follower_train, free_speed


def compute_settings(case: Case) -> list[Setting]:
    """Return the closed-form results of a case and of its listed settings."""
    model = build_model(case)
    where, contact = _single_item(
        "contacts", {n: one for n, one in model.cam_contacts.items() if isinstance(one, CamContact)}
    )
    if contact.stiffness is None or contact.follower in (rocker.start for rocker in model.rockers.values()):
        given = "a hertz contact, or a rocker on the follower"
        raise refuse(where, given, "a stiffness, and the valve at the follower", "the closed form is that of one mass")
    spring = _valve_spring(model, contact)
    mass, cam = follower_train(build_structure(model), contact, where).mass, model.cams[contact.cam]
    rows: list[tuple[str, float, float, float]] = [
        (case.name, case.speed, spring.stiffness, (spring.installed_force or 0.0) / spring.stiffness)
    ]
    for name, one in case.record.settings.items():
        given = one.camshaft_speed, one.stiffness, one.installed_compression
        speed, k, x0 = (own if new is None else new for new, own in zip(given, rows[0][1:], strict=True))
        rows.append((name, speed, k, x0))
    return [
        evaluate_setting(
            name, SingleMassModel(cam.event, mass, contact.stiffness, k, x0), _speed_function(case, cam, speed), speed
        )
        for name, speed, k, x0 in rows
    ]


def _single_item(kind: str, found: Mapping[str, CamContact]) -> tuple[str, CamContact]:
    if len(found) != 1:
        given = f"{len(found)} contacts of a cam in true contact"
        raise refuse(kind, given, "one", "the closed form is that of one mass under one cam")
    name, contact = next(iter(found.items()))
    return f"contacts.{name}", contact


def _valve_spring(model: Model, contact: CamContact) -> Spring:
    found = [one for one in model.springs.values() if one.installed_force and one.stiffness > 0.0]
    if len(found) != 1 or found[0].at != contact.follower:
        given = f"{len(found)} springs with stiffness and preload, not one at {contact.follower!r}"
        why, remedy = "the closed form is that of one mass on one spring", "give it an installed_compression"
        raise refuse("springs", given, f"one at {contact.follower!r}", why, remedy)
    return found[0]


def _speed_function(case: Case, cam: Cam, speed: float) -> AngleFunction:
    """Return the camshaft speed over the cam angle: that of a freely rotating cam or a constant."""
    free = case.record.run.free_running
    if free is None:
        return constant(speed)
    if cam.follower is None:
        why = "the inertia of the cam follows from its base circle"
        raise refuse("run.free_running.cam", "no base circle", "base_radius and follower", why, "add both")
    return free_speed(cam.event, cam.follower.base_radius, speed, free.cam_mass, free.follower_mass)
