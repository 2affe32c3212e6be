"""Time to write result files: a full field, and runs with and without their result file."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.processes import ROOT
from benchmarks.timing import minimum_time
from flexcam import prepare, read_case
from flexcam.analysis.preparation import PreparedRun
from flexcam.analysis.run import open_result_file
from flexcam.case.variants import with_elements
from flexcam.dynamics import Block, Response, Stats, Status, solve

CASE = ROOT / "cases/tayeb/model-3-shm.toml"
RUNS = ("tayeb/model-1-shm", "tayeb/model-3-shm", "li/valve-train", "pushrod-engine/intake", "direct-acting/bucket")
STEPS, ELEMENTS = 2000, 10


class BlockList:
    """Sink that stores all blocks."""

    def __init__(self) -> None:
        self.items: list[Block] = []

    def write(self, block: Block) -> None:
        """Store a block."""
        self.items.append(block)

    def close(self, status: Status, stats: Stats) -> None:
        """Store the final status."""
        self.final = status, stats


def run_full_field() -> tuple[PreparedRun, BlockList]:
    """Run the model with 102 nodes and all of 2000 steps saved, and return it with its blocks."""
    revolutions = f"run.revolutions={STEPS / 3600:.12f}"
    ready = prepare(with_elements(read_case(CASE, [revolutions, "output.field_every=1"]), ELEMENTS))
    blocks = BlockList()
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[blocks]).stats.steps == STEPS
    return ready, blocks


def write_blocks(ready: PreparedRun, blocks: BlockList, folder: Path) -> Path:
    """Write blocks into a result file."""
    file = open_result_file(ready, folder, overwrite=True)
    for block in blocks.items:
        file.write(block)
    file.close(*blocks.final)
    return file.path


def run_case(ready: PreparedRun, folders: Sequence[Path]) -> Response:
    """Run a case with a result file in each folder."""
    files = [open_result_file(ready, folder, overwrite=True) for folder in folders]
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=files)


def _times(name: str, folder: Path) -> dict[str, object]:
    """Return times of the steps and of reading, preparing and running a case, s, without and with a result file."""
    path = ROOT / f"cases/{name}.toml"
    ready = prepare(read_case(path))

    def complete(folders: Sequence[Path]) -> float:
        return minimum_time(lambda: run_case(prepare(read_case(path)), folders))

    steps = [minimum_time(lambda: run_case(ready, [])), minimum_time(lambda: run_case(ready, [folder]))]
    return {"case": name, "steps_s": steps, "run_s": [complete([]), complete([folder])]}


def measure_table() -> dict[str, object]:
    """Return times of a full field, and of runs with and without their files, s."""
    ready, blocks = run_full_field()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return {
            "nodes": len(ready.model.mesh.nodes), "steps": STEPS,
            "field_s": minimum_time(lambda: write_blocks(ready, blocks, folder)),
            "mb": write_blocks(ready, blocks, folder).stat().st_size / 1e6,
            "runs": [_times(case, folder) for case in RUNS],
        }  # fmt: skip
