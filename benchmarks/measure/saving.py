"""What saving costs: a full field written, and runs with their result files beside those without."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.processes import ROOT
from benchmarks.timing import least
from flexcam import prepare, read_case
from flexcam.analysis.preparation import PreparedRun
from flexcam.analysis.run import open_result_file
from flexcam.case.variants import with_elements
from flexcam.dynamics import Block, Response, Stats, Status, solve

CASE = ROOT / "cases/tayeb/model-3-shm.toml"
RUNS = ("tayeb/model-1-shm", "tayeb/model-3-shm", "li/valve-train", "pushrod-engine/intake", "direct-acting/bucket")
STEPS, ELEMENTS = 2000, 10


class Kept:
    """Sink that keeps the blocks as they come."""

    def __init__(self) -> None:
        self.blocks: list[Block] = []

    def write(self, block: Block) -> None:
        """Keep a block."""
        self.blocks.append(block)

    def close(self, status: Status, stats: Stats) -> None:
        """Keep how the run ended."""
        self.end = status, stats


def full_field() -> tuple[PreparedRun, Kept]:
    """Return a run of the model on 102 nodes, every step of 2000 saved, with its blocks."""
    turns = f"run.revolutions={STEPS / 3600:.12f}"
    ready = prepare(with_elements(read_case(CASE, [turns, "output.field_every=1"]), ELEMENTS))
    kept = Kept()
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[kept]).stats.steps == STEPS
    return ready, kept


def saved(ready: PreparedRun, kept: Kept, folder: Path) -> Path:
    """Write blocks into a result file."""
    file = open_result_file(ready, folder, overwrite=True)
    for block in kept.blocks:
        file.write(block)
    file.close(*kept.end)
    return file.path


def ran(ready: PreparedRun, folders: Sequence[Path]) -> Response:
    """Run a case, with its result file in each folder."""
    files = [open_result_file(ready, folder, overwrite=True) for folder in folders]
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=files)


def beside(name: str, folder: Path) -> dict[str, object]:
    """Return seconds of a case's steps, and of all from reading it to the end, without and with the result file."""
    path = ROOT / f"cases/{name}.toml"
    ready = prepare(read_case(path))

    def whole(folders: Sequence[Path]) -> float:
        return least(lambda: ran(prepare(read_case(path)), folders))

    steps = [least(lambda: ran(ready, [])), least(lambda: ran(ready, [folder]))]
    return {"case": name, "steps_s": steps, "run_s": [whole([]), whole([folder])]}


def measured() -> dict[str, object]:
    """Return seconds of a full field, and of runs with and without their files."""
    ready, kept = full_field()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return {
            "nodes": len(ready.model.mesh.nodes), "steps": STEPS,
            "field_s": least(lambda: saved(ready, kept, folder)), "mb": saved(ready, kept, folder).stat().st_size / 1e6,
            "runs": [beside(one, folder) for one in RUNS],
        }  # fmt: skip
