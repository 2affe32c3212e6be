"""Runs with goldens: every case and every small model, with each model of the ladder and each engine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.golden.records import BARE, FULL, LIGHT

ROOT = Path(__file__).parents[2]
MODELS = Path(__file__).parent / "models"

SHORT = ("run.revolutions=1", "run.steps_per_revolution=720")
"""One revolution: longer trajectories with contacts amplify rounding until results cannot be compared."""

LADDER: dict[str, tuple[tuple[str, ...], dict[str, int]]] = {
    "beams": ((), {"auto": BARE, "direct": FULL, "modal": LIGHT, "kernel": LIGHT}),
    "rigid": (("fidelity.model=rigid",), {"auto": FULL // 2, "direct": BARE, "kernel": BARE}),
    "sdof": (("fidelity.model=sdof",), {"direct": LIGHT, "kernel": BARE}),
    "chain": (("fidelity.model=chain",), {"direct": LIGHT, "modal": BARE, "kernel": LIGHT}),
    "modes": (("fidelity.modes=5",), {"direct": LIGHT, "kernel": BARE}),
    "craig-bampton": (("fidelity.modes=3", "fidelity.reduction=craig-bampton"), {"direct": LIGHT, "kernel": BARE}),
}
"""Model of the ladder to its overrides, and its engines with the number of samples of each."""

BEAMS = {"direct": LIGHT, "kernel": LIGHT}
LINEAR = {"direct": LIGHT, "modal": LIGHT, "kernel": LIGHT}


@dataclass(frozen=True)
class Run:
    """One run: its golden file, its name in it, the case, its overrides, and the number of samples."""

    golden: str
    name: str
    case: Path
    overrides: tuple[str, ...]
    samples: int

    @property
    def words(self) -> list[str]:
        """Words of `flexcam run` except the folder of the results."""
        settings = [word for override in self.overrides for word in ("--set", override)]
        return [str(self.case), *settings]


OWN: dict[str, tuple[str, ...]] = {
    "checks/cantilever": (),
    "checks/mathieu": ("run.revolutions=1",),
    "checks/leak-down": ("run.steps_per_revolution=500",),
    "checks/pump-up": (),
    "calculix-rocker/": ("run.revolutions=0.3", "run.steps_per_revolution=1800"),
    "cams/": (),
    "camshaft-4cyl/camshaft": ("run.revolutions=1", "run.steps_per_revolution=360"),
    "data/every-key": (),
    "data/every-engine": ("run.revolutions=0.1", "run.steps_per_revolution=2880"),
    "data/every-contact": ("run.steps_per_revolution=720",),
}
"""Overrides of cases that do not use `SHORT`."""

METHODS = {
    "hht": ('run.integrator={ method = "hht" }',),
    "generalized-alpha": ('run.integrator={ method = "generalized-alpha", rho_inf = 0.7 }',),
    "newmark-damped": ('run.integrator={ method = "newmark", beta = 0.3025, gamma = 0.6 }',),
    "bathe": ('run.integrator={ method = "bathe" }',),
    "adaptive": ("run.adaptive={ tolerance = 1e-6 }",),
}

VARIANTS: dict[str, dict[str, tuple[tuple[str, ...], dict[str, int]]]] = {
    "models/linear-train": {
        **{name: (settings, LINEAR) for name, settings in METHODS.items()},
        "radau": (('run.integrator={ method = "radau" }', "run.steps_per_revolution=90"), {"auto": LIGHT}),
        "rayleigh": (('run.damping={ alpha = "20 1/s", beta = "1e-6 s" }',), LINEAR),
        "modal-damping": (("run.damping={ modal = 0.02 }",), LINEAR),
        "periodic": (('run.start="periodic"', "run.damping={ modal = 0.05 }"), LINEAR),
        "rest": (('run.start="rest"',), LINEAR),
        "whole": (("fidelity.prune=false",), {"direct": LIGHT}),
        "gravity": (('run.gravity=[0, "-9.81 m/s^2", 0]',), {"direct": LIGHT}),
        "fluctuation": (("run.fluctuation={ orders = [2], amplitudes = [0.05] }",), LINEAR),
    },
    "models/lever-rocker": {
        "collocation": (('run.integrator={ method = "collocation" }',), {"kernel": LIGHT}),
        **{name: (settings, BEAMS) for name, settings in METHODS.items()},
        "periodic": (('run.start="periodic"',), BEAMS),
        "rest": (('run.start="rest"',), BEAMS),
        "chain-2": (("fidelity.model=chain", "fidelity.masses=2"), {"direct": LIGHT}),
    },
    "models/massless": {"hht": (METHODS["hht"], BEAMS), "slow": (('run.speed="600 rpm"',), BEAMS)},
    "models/swing": {
        "collocation": (('run.integrator={ method = "collocation" }',), {"kernel": LIGHT}),
        "periodic": (('run.start="periodic"',), BEAMS),
        "adaptive": (METHODS["adaptive"], BEAMS),
    },
    "models/hertz-train": {"rest": (('run.start="rest"',), BEAMS)},
    "models/two-cams": {"rest": (('run.start="rest"',), LINEAR), "hht": (METHODS["hht"], LINEAR)},
    "models/frame": {
        "central-difference": (('run.integrator={ method = "central-difference" }',), {"auto": LIGHT}),
        "central-difference-fine": (
            ('run.integrator={ method = "central-difference" }', "run.damping={ alpha = 2 }",
             "run.steps_per_revolution=36000", "run.revolutions=0.02"), LINEAR,
        ),
        "equilibrium": (('run.start="equilibrium"',), LINEAR),
        "consistent": (("members.post.mass=consistent", "members.arm.mass=consistent"), {"direct": LIGHT}),
    },
    "cases/pushrod-engine/intake": {"fast": (("run.crank_speed=\"6500 rpm\"",), BEAMS)},
    # Few modes of an engine with fingers, levers and oil columns: rounding shifts complete touchdowns.
    "data/every-engine": {model: (LADDER[model][0], {}) for model in ("modes", "craig-bampton")},
    # Few modes of a finger on oil with impacts on its seat amplify rounding to hundredths.
    "cases/direct-acting/finger": {"modes": (LADDER["modes"][0], {"direct": BARE})},
    "cases/tayeb/model-3-shm": {"deflection": (("contacts.intake.cam_deflection=true",), BEAMS)},
}  # fmt: skip
"""Further runs of some cases: overrides and engines."""


def cases() -> dict[str, Path]:
    """Return every case by name: shipped cases, small models, and the data of other tests."""
    folders = {"cases": ROOT / "cases", "models": MODELS}
    found = {
        f"{start}/{path.relative_to(folder).with_suffix('').as_posix()}": path
        for start, folder in folders.items()
        for path in sorted(folder.rglob("*.toml"))
    }
    return found | {f"data/{path.stem}": path for path in sorted((ROOT / "tests/data").glob("*.toml"))}


def _own_overrides(name: str) -> tuple[str, ...]:
    short = name.removeprefix("cases/")
    return next((settings for start, settings in OWN.items() if short.startswith(start)), SHORT)


def _engine(engine: str, settings: tuple[str, ...]) -> list[str]:
    """Return the overrides that select an engine, with the same integrator for all of them."""
    named = any(override.startswith("run.integrator") for override in settings)
    return [f"run.engine={engine}", *([] if named else ["run.integrator.method=newmark"])]


def _runs_of(name: str, path: Path) -> list[Run]:
    golden, base = name.replace("/", "-"), _own_overrides(name)
    models = LADDER | VARIANTS.get(name, {})
    if "/cams/" in name or name == "data/every-cam":
        models = {"beams": ((), {"auto": BARE})}
    return [
        Run(
            golden,
            f"{model}/{engine}",
            path,
            (*base, *settings, *([] if engine == "auto" else _engine(engine, settings))),
            samples,
        )
        for model, (settings, engines) in models.items()
        for engine, samples in engines.items()
    ]


def runs() -> list[Run]:
    """Return every run."""
    return [run for name, path in cases().items() for run in _runs_of(name, path)]
