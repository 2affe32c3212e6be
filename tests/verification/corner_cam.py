"""Follower of a plate cam with a jump in curvature, after an experiment on impacts and chaos in cam-follower systems.

R. Alzate, M. di Bernardo, U. Montanaro and S. Santini, Experimental and numerical verification of bifurcations and
chaos in cam-follower impacting systems, Nonlinear Dynamics 50 (2007) 409. The data are those of the example CamFollower
of Siconos: arcs about three centres under a knife-edge follower, no gravity.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexcam import prepare, read_case
from flexcam.cams import LiftEvent
from flexcam.case.builder import build_model

MASS, STIFFNESS, PRELOAD, RESTITUTION = 1.221, 1430.8, 143.08, 0.8
BASE = 0.4
FLANK, NOSE = (0.45, 0.85), (0.40393320723821, 0.15)
"""Distance of the arc centre from the cam axis, and radius of the arc, m."""

CORNER, RISE = 1.050328174371336, 1.22173047639603
"""Angles at the end of the flank and at the end of the nose arc, rad from the start of the rise."""

START = math.pi / 2.0
LIFT = sum(NOSE) - BASE


@dataclass(frozen=True)
class ArcLaw:
    """Lift law of two arcs: r = d cos(a) + sqrt(R^2 - d^2 sin^2 a), with a from the line through both centres."""

    @property
    def breaks(self):
        return (CORNER / RISE,)

    def __call__(self, z, order=0):
        b = RISE * np.asarray(z, dtype=float)
        flank = _arc(-FLANK[0], FLANK[1], np.minimum(b, CORNER), order)
        nose = _arc(*NOSE, np.maximum(b, CORNER) - RISE, order)
        return (np.where(b < CORNER, flank, nose) - (BASE if order == 0 else 0.0)) * RISE**order / LIFT


def _arc(d, R, a, order):
    """Return a derivative of the radius of an arc, by the Leibniz rule for the square of the root."""
    g = [R**2 - (d * np.sin(a)) ** 2, *(0.5 * d**2 * 2.0**n * np.cos(2.0 * a + 0.5 * n * math.pi) for n in range(1, 5))]
    w = [np.sqrt(g[0])]
    for n in range(1, order + 1):
        rest = sum(math.comb(n, i) * w[i] * w[n - i] for i in range(1, n))
        w.append((g[n] - rest) / (2.0 * w[0]))
    return d * np.cos(a + 0.5 * order * math.pi) + w[order]


EVENT = LiftEvent(ArcLaw(), LIFT, RISE, RISE, dwell=2.0 * (math.pi / 2.0 - RISE), phase=START)
PATH = Path(__file__).with_name("corner-impact.toml")


def prepared(rpm, *overrides):
    """Return the prepared run of the case with the cam of arcs, which the case format cannot describe."""
    case = read_case(PATH, [f"run.speed={rpm}rpm", *overrides])
    model = build_model(case)
    cam = replace(model.cams["cam"], event=EVENT)
    return prepare(case, model=replace(model, cams={"cam": cam}))
