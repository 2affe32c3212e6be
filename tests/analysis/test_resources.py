"""Estimated against actual resources of a run, and available resources of the system."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import flexcam
from flexcam.analysis import resources
from flexcam.analysis.preparation import prepare
from flexcam.analysis.resources import ResourceEstimate, check_resources, free_disk, free_memory
from flexcam.analysis.run import estimate_case_resources, open_result_file
from flexcam.core.errors import InputError
from flexcam.studies.sweep import check_sweep_resources, make_sweep
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
CASE = ROOT / "tests/data/inline.toml"

SIZES = {
    "one revolution": (CASE, []),
    "many revolutions": (CASE, ["run.revolutions=12"]),
    "every field": (CASE, ["output.field_every=1"]),
    "few fields": (CASE, ["run.revolutions=10", "output.field_every=10000"]),
    "many elements": (CASE, ["members.camshaft.elements=100", "run.revolutions=0.4"]),
    "a published train": (ROOT / "cases/tayeb/model-3-shm.toml", []),
    "an engine": (ROOT / "tests/data/every-engine.toml", ["run.revolutions=0.2", "run.engine=kernel"]),
}


@pytest.mark.parametrize("name", mostly_slow(SIZES, 2))
def test_file_size_matches_estimate(name, tmp_path):
    """Within 5 %: the estimate omits the index and headers of HDF5."""
    case, settings = SIZES[name]
    ready = prepare(flexcam.read_case(case, settings))
    sink = open_result_file(ready, tmp_path)
    assert flexcam.solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink]).status.ok
    assert estimate_case_resources(ready).file == pytest.approx(sink.path.stat().st_size, rel=0.05)


MEASURE_SCRIPT = """
import json, resource, sys
from pathlib import Path
import numba, scipy.linalg.lapack, scipy.sparse.linalg
import flexcam
from flexcam.dynamics.memory import ExtremesSink
from flexcam.analysis.run import estimate_case_resources, open_result_file, summary_sink
from flexcam.analysis.preparation import prepare
from flexcam.valvetrain import StrengthSink, build_structure
keep, case = sys.argv[1], flexcam.read_case(sys.argv[2], sys.argv[3:])
def taken():
    return int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) * 1024
before = taken()
ready = prepare(case)
few = summary_sink(ready)
sinks = [open_result_file(ready, "."), StrengthSink(build_structure(ready.model)), ExtremesSink(few.outline)]
memory = few if keep == "revolution" else None
response = flexcam.solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, memory=memory)
print(json.dumps([estimate_case_resources(ready, keep).memory, taken() - before, response.stats.engine]))
"""

RUNS = {
    "small": ("all", []),
    "kept whole": ("all", ["run.revolutions=20"]),
    "kept in part": ("revolution", ["run.revolutions=20"]),
    "long": ("all", ["run.revolutions=200"]),
    "machine code": ("all", ["run.revolutions=200", 'run.engine="kernel"']),
    "fields": ("all", ["run.revolutions=20", "output.field_every=1"]),
    "2e3 unknowns": ("revolution", ["members.camshaft.elements=100"]),
    "2e4 unknowns": ("revolution", ["members.camshaft.elements=1000"]),
}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peaks of memory as Linux tells them")
@pytest.mark.parametrize("name", RUNS)
def test_memory_matches_estimate(name, tmp_path):
    """Within a factor of two of the resident memory of the process."""
    keep, settings = RUNS[name]
    words = [sys.executable, "-c", MEASURE_SCRIPT, keep, str(CASE), *settings]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=True)
    estimate, measured, path = json.loads(done.stdout)
    assert (path == "kernel") == (name == "machine code")
    assert 0.5 < estimate / measured < 2.0


def test_memory_estimate_includes_histories_in_memory():
    cases = [prepare(flexcam.read_case(CASE, [f"run.revolutions={n}"])) for n in (10, 100, 1000)]
    short, long, longest = (estimate_case_resources(one).memory for one in cases)
    assert longest - long == pytest.approx(10 * (long - short), rel=0.01)
    assert len({estimate_case_resources(one, "revolution").memory for one in cases}) == 1


def test_too_large_run_error_states_sizes(monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 10_000_000)
    monkeypatch.setattr(resources, "free_disk", lambda _: 2_000_000_000)
    large = ResourceEstimate(20_000_000, 5_000_000_000)
    with pytest.raises(InputError) as refused:
        check_resources(large, Path("results"), together=2)
    memory, disk = refused.value.faults
    assert memory.given == "a run of 20 MB; 2 side by side"
    assert (memory.where, memory.allowed, memory.why) == ("memory", "up to 9 MB", "10 MB are free")
    assert (disk.where, disk.given, disk.allowed) == ("disk", "a result file of 5 GB", "up to 1.8 GB")
    assert "field_every" in disk.remedy
    assert "--allow-large" in memory.remedy
    check_resources(ResourceEstimate(3_000_000, 1), Path("results"))


def test_unknown_free_resources_cause_no_error(monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: None)
    monkeypatch.setattr(resources, "free_disk", lambda _: None)
    check_resources(ResourceEstimate(10**18, 10**18), Path())


def test_too_large_run_in_python_raises_error(monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 1_000_000)
    case = flexcam.read_case(CASE)
    with pytest.raises(InputError, match="memory: got a run of"):
        flexcam.run(case)
    assert flexcam.run(case, allow_large=True).status.ok


def test_too_large_mesh_raises_error_before_assembly(monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 1_000_000)
    case = flexcam.read_case(CASE, ["members.camshaft.elements=100"])
    with pytest.raises(InputError, match=r"301 elements, whose matrices need 2\.4 MB"):
        prepare(case)
    assert prepare(case, allow_large=True).problem.system.size > 1000


def test_too_large_sweep_raises_error(monkeypatch, tmp_path):
    asked = make_sweep(CASE, ["run.speed=1000:3000:1000rpm"])
    needs = estimate_case_resources(prepare(flexcam.read_case(CASE)))
    monkeypatch.setattr(resources, "free_memory", lambda: 2 * needs.memory)
    monkeypatch.setattr(resources, "free_disk", lambda _: 2 * needs.file)
    check_sweep_resources(asked, together=1)
    with pytest.raises(InputError, match="3 side by side"):
        check_sweep_resources(asked, together=3)
    with pytest.raises(InputError, match="disk: got a result file"):
        check_sweep_resources(asked, tmp_path)


def test_free_resources_are_positive():
    for free in (free_memory(), free_disk(Path("/no/such/folder"))):
        assert free is None or free > 0


def test_control_group_memory(tmp_path):
    """Version 2: limits of the group and of its parents; version 1: limit of the memory controller."""
    own = tmp_path / "cgroup"
    group = tmp_path / "root/batch/job"
    group.mkdir(parents=True)
    for folder, limit, used in ((group, "max", "5"), (group.parent, "1000", "400"), (group.parent.parent, "9999", "1")):
        (folder / "memory.max").write_text(limit + "\n")
        (folder / "memory.current").write_text(used + "\n")
    own.write_text("0::/batch/job\n")
    assert sorted(resources.control_group_memory(tmp_path / "root", own)) == [600, 9998]
    older = tmp_path / "root/memory/job"
    older.mkdir(parents=True)
    (older / "memory.limit_in_bytes").write_text("800")
    (older / "memory.usage_in_bytes").write_text("900")
    own.write_text("3:cpu,cpuacct:/job\n2:memory:/job\n")
    assert list(resources.control_group_memory(tmp_path / "root", own))[0] == 0  # noqa: RUF015
    assert list(resources.control_group_memory(tmp_path / "root", tmp_path / "nothing")) == []
