"""A sweep as a whole: a case and a plan that fit each other."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

from flexcam import __version__
from flexcam.case import CaseFile
from flexcam.case.lines import Places
from flexcam.checks import Fault, InputError, refuse
from flexcam.sweep.axis import LIMIT, Axis, axes, axis
from flexcam.sweep.bundle import Bundle, bundle_of
from flexcam.sweep.chunks import Chunk, chunk_size, chunks_of
from flexcam.sweep.named import check_names
from flexcam.sweep.plan import Plan, made_plan, sample
from flexcam.sweep.scalars import of_motion
from flexcam.sweep.validate import validated

GRID = "grid"


@dataclass(frozen=True, eq=False)
class Study:
    """A checked sweep: every variant can be read.

    Parameters
    ----------
    name
        Of the case; its files are named after it.
    title
        Of the case.
    plan
        The variants.
    bundle
        The case and its files, as they were when it was checked.
    size
        Variants per chunk.
    scalars
        Which are kept, by name or beginning; all where empty. Of the probes alone, nothing else is computed.
    """

    name: str
    title: str
    plan: Plan
    bundle: Bundle
    size: int
    scalars: tuple[str, ...] = ()

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """The plan in chunks."""
        return chunks_of(self.plan, self.size)

    def about(self) -> dict[str, str]:
        """Return what its table says of itself: the case, the plan and what computed it."""
        plan = {
            "set": {one.key: [value.text for value in one.values] for one in self.plan.axes},
            "intervals": [one.key for one in self.plan.axes if one.interval],
            "sample": None if self.plan.sample is None else asdict(self.plan.sample),
        }
        packages = ("numpy", "scipy", "h5py")
        return {
            "title": self.title,
            "case_file": self.bundle.name,
            "case": self.bundle.files[self.bundle.name].decode(),
            "files": self.bundle.digest,
            "plan": json.dumps(plan),
            "flexcam": __version__,
            **{package: version(package) for package in packages},
        }

    def belongs(self, *, histories: bool) -> dict[str, object]:
        """Return what a journal of it belongs to."""
        plan = hashlib.sha256(json.dumps([self.size, self.plan.variants]).encode()).hexdigest()
        return {
            "format": 1, "flexcam": __version__, "case": self.bundle.digest, "plan": plan, "histories": histories,
            "variants": len(self.plan), "channels": self.bundle.channels,
        }  # fmt: skip


def study(
    path: str | Path, settings: Sequence[str] = (), *, sampled: str | None = None, seed: int | None = None,
    scalars: Sequence[str] = (), limit: int = LIMIT,
) -> Study:  # fmt: skip
    """Return the sweep of a case, every variant of it checked."""
    file = CaseFile.opened(path)
    own = file.sweep
    if limit < 1:
        raise refuse("--limit", limit, "a whole number from 1", "it is the most variants that are run")
    found = _axes(file, settings, limit)
    how = sampled if sampled is not None else (own.sample if own else None) or GRID
    if seed is not None and how == GRID:
        why, remedy = "every combination is run, and none is drawn", "add --sample, or leave it out"
        raise refuse("--seed", seed, "--seed with --sample only", why, remedy)
    number = seed if seed is not None else own.seed if own else 0
    plan = made_plan(found, None if how == GRID else sample(how, number), limit=limit)
    first = validated(file, plan)
    if first.record.fidelity.estimate:
        where, why = first.place(("fidelity", "estimate")), "a sweep keeps what was computed, without estimates"
        raise refuse(where, "true", "false", why, "--set fidelity.estimate=false")
    kept = tuple(scalars or (own.scalars if own else ()))
    check_names(file, plan, kept)
    bundle = replace(bundle_of(file, plan), channels=not of_motion(kept))
    return Study(first.name, first.record.title, plan, bundle, chunk_size(plan, first), kept)


def _axes(file: CaseFile, settings: Sequence[str], limit: int) -> tuple[Axis, ...]:
    """Return the axes of the case's own table, with those of the command line over them and behind them."""
    own, places, faults = file.sweep, Places.of_text(file.text), list[Fault]()
    found: dict[str, Axis] = {}
    given = {setting.partition("=")[0].strip() for setting in settings}
    for key, spec in (own.set_ if own else {}).items():
        if key in given:
            found[key] = axis(key, "0")  # keeps its place
            continue
        try:
            found[key] = axis(key, spec, where=places.place(("sweep", "set", key)), limit=limit)
        except InputError as refusal:
            faults += refusal.faults
    try:
        found |= {one.key: one for one in axes(settings, limit=limit)}
    except InputError as refusal:
        faults += refusal.faults
    faults += [_strange(one) for one in found.values() if one.key.partition(".")[0] == "sweep"]
    if faults:
        raise InputError(faults)
    return tuple(found.values())


def _strange(one: Axis) -> Fault:
    return Fault(
        one.where, one.key, "a key of the mechanism or its run", "it says how to sweep", "see --sample, --seed"
    )
