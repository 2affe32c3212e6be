"""Sweep execution: identical tables from all executors, also with killed workers, failed rows and resumed journals."""

import errno
import json
import multiprocessing
import os
import signal
import subprocess
import sys
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from flexcam import InputError, read_case
from flexcam.case.reader import CaseFile
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.io.sweep_table import write_hdf5
from flexcam.studies import executors as workers_of
from flexcam.studies.evaluation import evaluate, evaluate_chunk
from flexcam.studies.executors import ClusterWorkers, Pool, ProcessWorkers, SerialWorkers, divide_variants, open_runner
from flexcam.studies.journal import Journal
from flexcam.studies.plan import Bundle, Plan, Row, catch_all_errors, evaluate_each, make_bundle, parse_axes
from flexcam.studies.sweep import chunk_size, make_sweep, run_sweep

ROOT = Path(__file__).parents[2]
TAYEB = ROOT / "cases/tayeb/model-1-shm.toml"
QUICK = ["run.revolutions=0.25", "run.steps_per_revolution=720"]
VARIED = [*QUICK, "run.speed=1000:2000:250rpm", "springs.valve.stiffness=30,40kN/m"]


def table_bytes(table, folder, name):
    path = folder / f"{name}.h5"
    write_hdf5(table, path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def sweep():
    return make_sweep(TAYEB, VARIED)


@pytest.fixture(scope="module")
def serial_bytes(sweep, tmp_path_factory):
    return table_bytes(run_sweep(sweep, SerialWorkers()), tmp_path_factory.mktemp("alone"), "here")


def kill_worker_once(pid_of):
    """Return a progress callback that kills a worker after the first rows, and the list of killed processes."""
    killed = []

    def advance(count):
        if not killed:
            killed.append(pid_of())
            os.kill(killed[0], signal.SIGKILL)

    return advance, killed


def worker_process():
    return next(p.pid for p in multiprocessing.active_children() if p.name.startswith("SpawnProcess"))


def test_processes_give_same_table_with_killed_worker(sweep, serial_bytes, tmp_path):
    advance, killed = kill_worker_once(worker_process)
    assert table_bytes(run_sweep(sweep, ProcessWorkers(2), advance=advance), tmp_path, "two") == serial_bytes
    assert killed
    assert not [p for p in multiprocessing.active_children() if p.name.startswith("SpawnProcess")]


def dask_worker():
    from distributed.client import default_client

    return sorted(default_client().run(os.getpid).values())[0]


@pytest.mark.slow
def test_local_cluster_gives_same_table_with_killed_worker(sweep, serial_bytes, tmp_path):
    advance, killed = kill_worker_once(dask_worker)
    assert table_bytes(run_sweep(sweep, ClusterWorkers("local", 2), advance=advance), tmp_path, "dask") == serial_bytes
    assert killed


class ScriptedWorkers:
    """Workers in which a variant with the key ``poison`` kills its worker and breaks the pool."""

    def __init__(self):
        self.submitted = []

    @contextmanager
    def open_pool(self, source):
        broken = []

        def submit(evaluate, variants):
            future = Future()
            if broken:
                raise BrokenProcessPool
            self.submitted.append(variants)
            if any("poison" in key for variant in variants for key in variant):
                broken.append(True)
                future.set_exception(BrokenProcessPool())
            else:
                future.set_result([Row(Status(text=variant[0])) for variant in variants])
            return future

        yield workers_of.Pool(submit, 3, (BrokenProcessPool,))


def test_variant_that_kills_worker_is_failed_row():
    plan = Plan(parse_axes(["key=a,b,poison,d,e,f,g,h"]))
    chunks, workers = divide_variants(plan.variants, 3), ScriptedWorkers()
    with open_runner(workers, Bundle("", "", {})) as run:
        rows = {chunk.index: some for chunk, some in run(evaluate_chunk, chunks)}
    found = [row.status for _, some in sorted(rows.items()) for row in some]
    assert [status.cause for status in found] == [Cause.WORKER_LOST if i == 2 else Cause.DONE for i in range(8)]
    assert [status.text for status in found if status.ok] == [f"key={letter}" for letter in "abdefgh"]
    assert workers.submitted.count((("key=poison",),)) == 1
    assert workers.submitted.count(chunks[2].variants) == 1  # chunks that were not running are not repeated


def test_cluster_without_workers_ends_sweep(sweep, monkeypatch):
    """Otherwise the sweep would wait forever."""
    monkeypatch.setattr(workers_of, "_PATIENCE", 0.01)

    class Empty:
        @contextmanager
        def open_pool(self, source):
            yield Pool(lambda evaluate, variants: Future(), 2, (), lambda: False)

    with (
        pytest.raises(RunFailedError, match="no workers left"),
        open_runner(Empty(), sweep.bundle) as run,
    ):
        list(run(sweep.evaluate(), sweep.chunks))


def test_failed_run_is_row_with_cause():
    # Newmark with beta near 0 is stable up to omega dt = 2 only
    methods = ",".join(f"{{ method = 'newmark', beta = {beta} }}" for beta in (0.25, 0.001))
    table = run_sweep(make_sweep(TAYEB, ["run.steps_per_revolution=360", f"run.integrator={methods}"]))
    assert [status.cause for status in table.statuses] == [Cause.DONE, Cause.NOT_FINITE]
    assert table.failed == (1,)
    assert "cam angle" in table.statuses[1].text
    assert table["deviation.peak"][0] > 0.0
    assert table["deviation.peak"][1] != table["deviation.peak"][1]  # NaN


def test_input_error_and_program_error_are_rows(monkeypatch):
    row = evaluate(read_case(TAYEB, ["run.revolutions=0.0001"]))
    assert row.status.cause is Cause.REFUSED
    assert "at least one step" in row.status.text

    def raise_error(ready, response, names=None):
        raise ZeroDivisionError("nothing")

    monkeypatch.setattr(sys.modules["flexcam.studies.evaluation"], "compute_scalars", raise_error)
    row = evaluate(read_case(TAYEB, QUICK))
    assert row.status.cause is Cause.FAULT
    assert "ZeroDivisionError: nothing (test_sweep_execution.py:" in row.status.text


def test_bundle_contains_files_of_case(tmp_path):
    """A worker needs plain data only: the mesh above the case and the lift table next to it are unpacked elsewhere."""
    law = 'law = "shm"\nlift = "6 mm"\nrise = "180 deg"\nreturn = "180 deg"'
    text = TAYEB.read_text(encoding="utf-8").replace(law, 'lift_table = "lift.csv"')
    home = tmp_path / "home/cases"
    home.mkdir(parents=True)
    (tmp_path / "home/case.msh").write_bytes((ROOT / "meshes/tayeb-1.msh").read_bytes())
    (home / "lift.csv").write_bytes((ROOT / "tests/data/lift.csv").read_bytes())
    (home / "case.toml").write_text(text.replace("../../meshes/tayeb-1.msh", "../case.msh"), encoding="utf-8")
    bundle = make_bundle(CaseFile.open(home / "case.toml"), Plan(parse_axes(["mesh=../case.msh,../none.msh"])))
    assert set(bundle.files) == {"case.toml", "lift.csv", "../case.msh"}
    unpacked = bundle.unpack(tmp_path / "far/away")
    assert unpacked.is_relative_to(tmp_path / "far/away")
    assert (tmp_path / "far/away").resolve() in (unpacked.parent / "../case.msh").resolve().parents
    here = evaluate_chunk(home / "case.toml", [tuple(QUICK)])[0]
    (tmp_path / "home").rename(tmp_path / "gone")
    there = evaluate_chunk(bundle, [tuple(QUICK), ("mesh=../none.msh",)])
    assert there[0].scalars == here.scalars
    assert there[1].status.cause is Cause.REFUSED
    assert str(tmp_path) not in there[1].status.text
    assert "flexcam-" not in there[1].status.text


def thread_counts(case, variants):
    return [one["num_threads"] for one in threadpool_info()]


def test_worker_processes_use_one_blas_thread(sweep, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with ProcessWorkers(1).open_pool(sweep.bundle) as pool:
        assert set(pool.submit(thread_counts, [()]).result()) == {1}


@pytest.mark.slow
def test_unguarded_script_causes_worker_error(tmp_path):
    script = (
        "from flexcam.studies import executors, sweep\n"
        f"sweep.run_sweep(sweep.make_sweep({str(TAYEB)!r}, {VARIED!r}), executors.ProcessWorkers(2))\n"
    )
    (tmp_path / "script.py").write_text(script, encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    expected = "flexcam.dynamics.status.RunFailedError: worker-lost: no worker process could"
    assert [line for line in done.stderr.splitlines() if line.startswith(expected)]  # Python may add lines after it


def test_chunks_do_not_depend_on_executor():
    case = read_case(TAYEB)
    many, few = Plan(parse_axes(["run.speed=1:5000:1rpm"])), Plan(parse_axes(["run.speed=1:50:1rpm"]))
    assert (chunk_size(many, case), chunk_size(few, case)) == (16, 1)
    assert chunk_size(many, case.with_run({"revolutions": 100.0})) == 1  # a long run is a separate chunk
    assert [one for chunk in divide_variants(many.variants, 16) for one in chunk.variants] == list(many.variants)


HEAD = {"format": 1, "flexcam": "1", "case": "c", "plan": "p", "histories": False}
ROWS = [
    Row(Status(), {"x": 0.1 + 0.2, "y": 1e-300}, {"x": "m", "y": "N"}, 1.5),
    Row(Status(Cause.REFUSED, "no", "yes")),
]


def write_journal(path, chunks, **how):
    journal = Journal(path, HEAD, **how)
    for index in chunks:
        journal.add(index, ROWS)
    journal.close()
    return journal.rows


def test_truncated_journal_resumes_from_last_complete_line(tmp_path):
    path = tmp_path / "j.jsonl"
    write_journal(path, [0, 1])
    whole = path.read_bytes()
    ends = [i + 1 for i, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(0, len(whole) + 1, 7):
        path.write_bytes(whole[:length])
        found = write_journal(path, [], resume=True)
        assert set(found) == set(range(sum(end <= length for end in ends[1:])))
        assert all(rows == ROWS for rows in found.values())
        write_journal(path, [i for i in (0, 1) if i not in found], resume=True)
        assert path.read_bytes() == whole


def test_foreign_or_locked_journal_raises_error(tmp_path):
    path = tmp_path / "j.jsonl"
    write_journal(path, [0])
    whole = path.read_bytes()
    for words, change in (("version", {"flexcam": "2"}), ("a file it names", {"case": "d"}), ("values", {"plan": "q"})):
        with pytest.raises(InputError, match=rf"^progress file: .* belongs to another sweep; what differs: .*{words}"):
            Journal(path, HEAD | change, resume=True)
    with pytest.raises(InputError, match="resume finishes it"):
        Journal(path, HEAD)
    first = Journal(path, HEAD, resume=True)
    with pytest.raises(InputError, match="Another sweep is running here"):
        Journal(path, HEAD, resume=True)
    first.close()
    Journal(path, HEAD, overwrite=True).close()  # the journal is still empty
    path.write_bytes(whole[:-40] + b"}\n")
    with pytest.raises(InputError, match="damaged"):
        Journal(path, HEAD, resume=True)
    path.write_bytes(whole)
    assert json.loads(path.read_bytes().splitlines()[0]).items() >= HEAD.items()


def test_flipped_bit_in_journal_gives_no_wrong_numbers(tmp_path):
    path = tmp_path / "j.jsonl"
    write_journal(path, [0, 1])
    whole = path.read_bytes()
    for position in range(0, len(whole), 3):
        path.write_bytes(whole[:position] + bytes([whole[position] ^ 1]) + whole[position + 1 :])
        with suppress(InputError):
            assert all(rows == ROWS for rows in write_journal(path, [], resume=True).values())


def no_locks(*_):
    raise OSError(errno.ENOLCK, "No locks available")


def no_module(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)


@pytest.mark.parametrize("without", [lambda patch: patch.setattr("fcntl.flock", no_locks), no_module])
def test_journal_without_file_locks(without, tmp_path, monkeypatch):
    """Some network drives do not support locks; the sweep runs without exclusive access."""
    without(monkeypatch)
    write_journal(tmp_path / "j.jsonl", [0])
    assert write_journal(tmp_path / "j.jsonl", [], resume=True) == {0: ROWS}


def test_empty_journal_leaves_no_file(tmp_path):
    Journal(tmp_path / "new/j.jsonl", HEAD).close()
    assert not list((tmp_path / "new").iterdir())


def test_program_error_in_variant(tmp_path):
    """A program error in flexcam ends a search, and is one row of a sweep."""

    def raise_error(case):
        raise TypeError("planted")

    with pytest.raises(TypeError, match="planted"):
        evaluate_each(TAYEB, [()], raise_error)
    row = catch_all_errors(lambda: raise_error(None))
    assert row.status.cause is Cause.FAULT
    assert "TypeError: planted" in row.status.text
