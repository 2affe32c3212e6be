"""Self-test of an installation: computed values compared with reference values."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import numpy as np

from flexcam.analysis.comparison import excited_mode
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.cams import LAWS, criteria
from flexcam.case.reader import read_case
from flexcam.case.starters import new_case
from flexcam.core import FloatArray, Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    constant,
    elastic_stop,
    equilibrium,
    modes,
    newmark,
    solve,
    static_displacement,
)
from flexcam.dynamics.jit import cache_root
from flexcam.dynamics.kernel_step import PROGRAM
from flexcam.fem.assembly import Member, build_beams, geometric, mass, stiffness
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Material, Section
from flexcam.io import read_result, temporary_folder


@dataclass(frozen=True)
class Check:
    """Computed value with its reference."""

    quantity: str  #: name of the quantity
    source: str  #: source of the reference
    #: `reference`, `computed`: values in `unit`
    reference: float
    computed: float
    tolerance: float  #: maximum relative error; absolute if the reference is zero
    unit: str = "1"  #: unit of both values

    @property
    def error(self) -> float:
        """Relative error; absolute if the reference is zero."""
        return abs(self.computed - self.reference) / (abs(self.reference) or 1.0)

    @property
    def passed(self) -> bool:
        """Return whether the error is within its tolerance; False for NaN."""
        return self.error <= self.tolerance


_PACKAGES = ("flexcam", "numpy", "scipy", "h5py", "meshio", "pydantic", "matplotlib", "pyvista", "numba")
_EXTRAS = {
    "tables": ("pandas", "pyarrow"),
    "cluster": ("distributed",),
    "movie": ("imageio", "imageio_ffmpeg"),
    "design": ("pymoo",),
    "mdf": ("asammdf",),
}
"""Extras of the package and their required modules."""


def installation_info() -> dict[str, str]:
    """Return the versions and optional parts of this installation."""
    info = {"python": f"{platform.python_version()}, {platform.platform()}"}
    for package in _PACKAGES:
        try:
            info[package] = version(package)
        except PackageNotFoundError:
            info[package] = "not installed"
    info["compiled code"] = "missing: install numba, and leave NUMBA_DISABLE_JIT unset"
    if PROGRAM.load_extension() is not None:
        info["compiled code"] = "part of this installation"
    elif PROGRAM.is_available():
        info["compiled code"] = f"compiled at first use, kept in {cache_root()}"
    for extra, modules in _EXTRAS.items():
        missing = ", ".join(name for name in modules if find_spec(name) is None)
        info[f"extra {extra}"] = f"not there ({missing}): pip install 'flexcam[{extra}]'" if missing else "installed"
    return info


_G, _V0, _STIFFNESS = 9.81, 1.2, 4e6  # gravity, initial impact speed, stiffness of the stop; the mass is 1 kg
_STILL = ConstantSpeed(1.0)
_PROBE = Probe("x", ("x",), np.eye(1), (None,))


def _period_check() -> Iterator[Check]:
    """Yield a free vibration after 1000 steps of a tenth of its period, by the average acceleration method."""
    angle, step = 2.0 * math.pi / 10.0, 0.01
    stiffness = Triplets.from_dense([[(angle / step) ** 2]])
    system = System(Triplets.from_dense([[1.0]]), Triplets.zeros(1), stiffness, ("x",), probes=(_PROBE,))
    problem = Problem(system, _STILL, step, 1000, State(np.ones(1), np.zeros(1)), engine="direct")
    end = solve(problem, newmark())["x"].displacement[-1]
    source = "Hughes, The Finite Element Method, ch. 9"
    yield Check("Newmark after 100 periods", source, math.cos(2000.0 * math.atan(0.5 * angle)), float(end), 1e-9, "m")


def _bounce_checks() -> Iterator[Check]:
    source = "Goldsmith, Impact, ch. 4"
    down, up = AngleVector.constant(np.array([-1.0])), AngleVector.constant(np.array([1.0]))
    stop = LocalForce("stop", (down,), (up,), elastic_stop(_STIFFNESS), (constant(0.0),))
    weight = Load("weight", np.array([-_G]), lambda motion: np.ones_like(motion.angle))
    zero = Triplets.zeros(1)
    system = System(Triplets.from_dense([[1.0]]), zero, zero, ("x",), (weight,), (stop,), probes=(_PROBE,))
    w, deflection = math.sqrt(_STIFFNESS), _G / _STIFFNESS
    contact = 2.0 / w * (math.pi - math.atan(_V0 * w / _G))
    steps, total = 1000, 1.5 * contact
    start = State(np.zeros(1), np.array([-_V0]))
    history = solve(Problem(system, _STILL, total / steps, steps, start, engine="direct"), newmark())["x"]
    depth = deflection + math.hypot(deflection, _V0 / w)
    # Steps of w dt = 0.005: the relative error of the period is its square over 12; that of an event speed is similar.
    yield Check("depth of an impact", source, depth, -float(history.displacement.min()), 1e-5, "m")
    yield Check("speed after an impact", source, _V0 - _G * (total - contact), float(history.velocity[-1]), 1e-5, "m/s")
    rest = equilibrium(system, _STILL).displacement
    yield Check("mass at rest on a stop", "m g/k", -deflection, float(rest[0]), 1e-9, "m")


def _law_checks() -> Iterator[Check]:
    source = "derivatives of the law, by hand"
    for name, velocity, acceleration in (
        ("cycloidal", 2.0, 2.0 * math.pi),
        ("shm", 0.5 * math.pi, 0.5 * math.pi**2),
        ("3-4-5", 1.875, 10.0 / math.sqrt(3.0)),
    ):  # fmt: skip
        values = criteria(LAWS[name])
        yield Check(f"largest velocity of the law {name}", source, velocity, values.velocity[1].value, 1e-9)
        yield Check(f"largest acceleration of the law {name}", source, acceleration, values.acceleration[1].value, 1e-9)


_STEEL = Material(E=207e9, nu=0.29, density=7800.0)
_TUBE = Section.tube(0.020, 0.012)
_LENGTH, _ELEMENTS = 0.9, 16
_SLENDER, _STOUT = Member(_STEEL, _TUBE, rotary_inertia=False), Member(_STEEL, _TUBE, shear=True)
_FIXED, _PINNED = ("ux", "uy", "uz", "rx", "ry", "rz"), ("ux", "uy", "uz", "rx", "ry")


class _Beam:
    """Straight beam along x with equal elements, fixed at its start and optionally at its end."""

    def __init__(self, member: Member, start: tuple[str, ...], end: tuple[str, ...] = ()) -> None:
        mesh = chain((0.0, 0.0, 0.0), (_LENGTH, 0.0, 0.0), _ELEMENTS)
        self._beams = build_beams(mesh, {"shaft": member})
        self._dofs = dof_map(mesh, [("start", start), *([("end", end)] if end else [])])
        self._stiffness = stiffness(self._beams, self._dofs)
        in_plane = [i for i, name in enumerate(self._dofs.names) if name.endswith((".uy", ".rz"))]
        self._bending = np.array(in_plane, dtype=np.intp)  #: degrees of freedom of bending in the x-y plane

    def end_displacement(self, component: str, size: float) -> float:
        """Return the displacement of the end under a force or torque."""
        load = size * self._dofs.unit(f"end.{component}")
        return float(static_displacement(self._stiffness, load, self._dofs.names) @ load) / size

    def frequencies(self, count: int) -> FloatArray:
        """Return the lowest bending frequencies in the x-y plane, Hz."""
        inertia = mass(self._beams, self._dofs).part(self._bending)
        return modes(inertia, self._stiffness.part(self._bending), count).frequencies

    def buckling_load(self) -> float:
        """Return the buckling load, N."""
        softened = geometric(self._beams, np.full(len(self._beams), -1.0), self._dofs).part(self._bending).dense()
        stiff = self._stiffness.part(self._bending).dense()
        return 1.0 / float(np.linalg.eigvals(np.linalg.solve(stiff, -softened)).real.max())


_CANTILEVER_ROOTS = (1.8751040687119611, 4.694091132974174, 7.854757438237613)  # roots of cos(x) cosh(x) = -1


def _structure_checks() -> Iterator[Check]:
    beam, force, torque = _Beam(_SLENDER, _FIXED), 100.0, 10.0
    deflection, computed = force * _LENGTH**3 / (3.0 * _STEEL.E * _TUBE.Iz), beam.end_displacement("uy", force)
    yield Check("tip of a cantilever under a force", "Euler-Bernoulli, P L^3/(3 E I)", deflection, computed, 1e-9, "m")
    twist, computed = torque * _LENGTH / (_STEEL.G * _TUBE.J), beam.end_displacement("rx", torque)
    yield Check("twist of a tube under a torque", "Saint-Venant, T L/(G J)", twist, computed, 1e-9, "rad")
    source = "Timoshenko, Vibration Problems in Engineering, sec. 53-58"
    speed = math.sqrt(_STEEL.E * _TUBE.Iz / (_STEEL.density * _TUBE.A))
    for n, (root, computed) in enumerate(zip(_CANTILEVER_ROOTS, beam.frequencies(3), strict=True), start=1):
        # Cubic elements: relative frequency error (x/n)^4/1440; the tolerance is twice that.
        reference = root**2 / (2.0 * math.pi * _LENGTH**2) * speed
        tolerance = (root / _ELEMENTS) ** 4 / 720.0
        quantity = f"bending frequency {n} of a cantilever"
        yield Check(quantity, source, reference, float(computed), tolerance, "Hz")
    # A pinned Timoshenko beam with wave number k: the lower root of a w^4 + b w^2 + c = 0.
    k, shear = math.pi / _LENGTH, _TUBE.kappa_y * _STEEL.G
    a = _STEEL.density**2 * _TUBE.Iz / shear
    b = -_STEEL.density * (_TUBE.A + _TUBE.Iz * k**2 * (1.0 + _STEEL.E / shear))
    c = _STEEL.E * _TUBE.Iz * k**4
    reference = math.sqrt(2.0 * c / (-b + math.sqrt(b**2 - 4.0 * a * c))) / (2.0 * math.pi)
    computed = float(_Beam(_STOUT, _PINNED, ("uy", "uz")).frequencies(1)[0])
    yield Check("bending frequency of a stout beam, pinned", source, reference, computed, 1e-5, "Hz")
    source = "Timoshenko and Gere, Theory of Elastic Stability, ch. 2"
    euler = math.pi**2 * _STEEL.E * _TUBE.Iz / _LENGTH**2
    computed = _Beam(_SLENDER, _PINNED, ("uy", "uz")).buckling_load()
    yield Check("buckling load of a pinned column", source, euler, computed, 1e-5, "N")


_PROBED = "valve"


def _train_checks() -> Iterator[Check]:
    with temporary_folder() as folder:
        case = read_case(new_case("published-model", folder / "case.toml")[0])
        source, resonant = "flexcam 0.1 (paper of Tayeb and Sliman: near 4000 rpm)", 60.0 * excited_mode(case)
        quantity = "resonance speed of the mode that the cam force excites"
        yield Check(quantity, source, 4027.0, resonant, 0.5 / 4027.0, "rpm")
        ready = prepare(case)
        sink = open_result_file(ready, folder)
        run = solve(replace(ready.problem, engine="direct"), ready.scheme, save=ready.save, sinks=[sink])
        residual = float(np.abs(run.channels["energy.residual"]).max() / np.ptp(run.channels["energy.work"]))
        source = "Newmark's average acceleration conserves energy"
        yield Check("residual of the energy balance, divided by the work", source, 0.0, residual, 1e-9)
        displacement = run[_PROBED].displacement
        for engine in ("modal", "kernel") if PROGRAM.is_available() else ("modal",):
            second = solve(replace(ready.problem, engine=engine), ready.scheme, save=ready.save)
            difference = float(np.abs(displacement - second[_PROBED].displacement).max() / np.abs(displacement).max())
            yield Check(f"{engine} solver engine, against the direct one", "the same scheme", 0.0, difference, 1e-8)
        stored = read_result(sink.path).response
        pairs = [(getattr(run.probes, kind), getattr(stored.probes, kind)) for kind in ("displacement", "velocity")]
        pairs += [(run.time, stored.time), *((values, stored.channels[name]) for name, values in run.channels.items())]
        difference = max(float(np.abs(a - b).max(initial=0.0)) for a, b in pairs)
        yield Check("result file, read values against written ones", "all digits equal", 0.0, difference, 0.0)
        rigid = prepare(case, rigid=True)
        top = float(solve(rigid.problem, rigid.scheme, save=rigid.save)[_PROBED].displacement.max())
        rocker, cam = next(iter(rigid.model.rockers.values())), next(iter(rigid.model.cams.values()))
        lift = cam.event.height * rocker.ratio
        yield Check("lift of the rigid train", "cam lift times rocker ratio", lift, top, 1e-6, "m")


def all_checks() -> Iterator[Check]:
    """Yield all checks as they are computed."""
    for checks in (_structure_checks, _period_check, _bounce_checks, _law_checks, _train_checks):
        yield from checks()
