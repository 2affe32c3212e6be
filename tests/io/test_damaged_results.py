"""Damaged results are refused, with the name of the damaged part, or read correctly."""

from pathlib import Path
from random import Random

import h5py
import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, read_result
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.run import open_result_file
from flexcam.cli.main import main
from flexcam.dynamics import solve
from flexcam.io.sweep_table import read_table
from tests.fuzz import damage
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
FLIPS = 15


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    """Return the folder of a valid result and a valid table."""
    folder = tmp_path_factory.mktemp("sound")
    damage.make_seeds(folder)
    return folder


@pytest.mark.parametrize(
    ("name", "read", "differs"),
    [("small.vtkhdf", read_result, damage.result_differs), ("small.sweep.h5", read_table, damage.table_differs)],
)
def test_flipped_bit_is_refused_or_harmless(name, read, differs, seeds, tmp_path, tried):
    """One bit is flipped at a time, anywhere in the file, including index and padding."""
    random, content, valid = Random(7), (seeds / name).read_bytes(), read(seeds / name)
    refused = 0
    for _ in range(FLIPS):
        data = bytearray(content)
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        (tmp_path / name).write_bytes(data)
        try:
            read_anew = read(tmp_path / name)
        except InputError:
            refused += 1
        else:
            assert not differs(read_anew, valid)
    assert refused > 0.2 * FLIPS
    outcome = f"{refused} refused, {FLIPS - refused} read correctly"
    tried("damaged", f"a bit flipped, {'result' if 'vtk' in name else 'table of a sweep'}", FLIPS, outcome)


@pytest.mark.parametrize("name", ["small.vtkhdf", "small.sweep.h5"])
def test_truncated_file_is_refused(name, seeds, tmp_path, tried):
    content = (seeds / name).read_bytes()
    lengths = [0, 1, 7, 8, 100, 512, *np.linspace(600, len(content) - 1, 30).astype(int).tolist()]
    for length in lengths:
        (tmp_path / name).write_bytes(content[:length])
        with pytest.raises(InputError):
            (read_result if "vtk" in name else read_table)(tmp_path / name)
    tried("damaged", f"cut off, {'result' if 'vtk' in name else 'table of a sweep'}", len(lengths), "refused")


def _dataset_bytes(path, name):
    """Return the position in the file of the first byte of a dataset."""
    with h5py.File(path) as file:
        stored = []
        file[name].id.chunk_iter(stored.append)
        return stored[0].byte_offset


def test_all_damaged_datasets_are_named(seeds, tmp_path, tried):
    path, names = tmp_path / "two.vtkhdf", ("/history/cam_angle", "/VTKHDF/PointData/stress_axial", "/mesh/nodes")
    data = bytearray((seeds / "small.vtkhdf").read_bytes())
    for name in names:
        data[_dataset_bytes(seeds / "small.vtkhdf", name) + 3] ^= 64
    path.write_bytes(data)
    with pytest.raises(InputError) as refusal:
        read_result(path)
    assert {fault.where for fault in refusal.value.faults} == {f"{path}, {name}" for name in names}
    tried("damaged", "numbers of three datasets", 3, "refused, each named")


def test_missing_chunk_is_refused(seeds, tmp_path, tried):
    """HDF5 reads a missing chunk as zeros, whose fletcher32 checksum is zero."""
    path = tmp_path / "lost.vtkhdf"
    with h5py.File(seeds / "small.vtkhdf") as old, h5py.File(path, "w") as new:
        for name in old:
            old.copy(name, new)
        new.attrs["seal"] = old.attrs["seal"]
        time = new["history/time"]
        attributes = dict(time.attrs)
        del new["history/time"]
        chunked = {"maxshape": (None,), "chunks": time.chunks, "fletcher32": True}
        again = new.create_dataset("history/time", time.shape, "f8", **chunked)
        again.attrs["units"] = attributes["units"]
    with pytest.raises(InputError, match=r"history/time|seal"):
        read_result(path)
    tried("damaged", "a chunk lost, which HDF5 reads as zeros", 1, "refused")


CHANGES = {
    "a probe renamed": lambda file: file.move("history/probes/valve", "history/probes/velve"),
    "a unit changed": lambda file: file["history/time"].attrs.modify("units", np.bytes_(b"h")),
    "steps counted down": lambda file: file["history"].attrs.modify("steps", 30),
    "the case changed": lambda file: file["about/case"].write_direct(np.array(b"format = 1", file["about/case"].dtype)),
    "the cause changed": lambda file: file["status/cause"].write_direct(np.array(b"dnne", file["status/cause"].dtype)),
    "a dataset cut": lambda file: file["history/cam_angle"].resize((10,)),
    "one number changed": lambda file: file["history/time"].__setitem__(3, 0.5),
    "the seal gone": lambda file: file.attrs.__delitem__("seal"),
    "a newer format": lambda file: file["about/format"].write_direct(np.array(b"9", file["about/format"].dtype)),
}


@pytest.mark.parametrize("what", mostly_slow(CHANGES, 2))
def test_result_changed_with_hdf5_is_refused(what, seeds, tmp_path, tried):
    """HDF5 updates its own checksums."""
    path = tmp_path / "changed.vtkhdf"
    path.write_bytes((seeds / "small.vtkhdf").read_bytes())
    with h5py.File(path, "r+") as file:
        CHANGES[what](file)
    with pytest.raises(InputError, match="changed"):
        read_result(path)
    tried("damaged", f"result: {what}", 1, "refused")


@pytest.mark.parametrize(
    "words", [b"", b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n" + bytes(5000), b"PK\x03\x04", b"[run]\n"]
)
def test_other_file_types_are_refused(words, tmp_path, tried):
    (tmp_path / "other.vtkhdf").write_bytes(words)
    for read in (read_result, read_table):
        with pytest.raises(InputError, match="other"):
            read(tmp_path / "other.vtkhdf")
    tried("damaged", f"a file that begins with {words[:8]!r}", 2, "refused")


def _run_command(words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, words)))
    captured = capsys.readouterr()
    return int(ended.value.code or 0), captured.out, captured.err


def test_info_of_damaged_result(seeds, tmp_path, capsys):
    """The exit code is 0 for a valid file, and 2 with a line per damaged dataset."""
    assert _run_command(["info", seeds / "small.vtkhdf"], capsys)[0] == 0
    data = bytearray((seeds / "small.vtkhdf").read_bytes())
    data[_dataset_bytes(seeds / "small.vtkhdf", "/history/cam_angle")] ^= 1
    (tmp_path / "bad.vtkhdf").write_bytes(data)
    code, _, err = _run_command(["info", tmp_path / "bad.vtkhdf"], capsys)
    assert code == 2
    assert "/history/cam_angle" in err
    assert "Traceback" not in err


def test_partial_result_is_read(tmp_path):
    case = read_case(ROOT / "tests/data/inline.toml", ["run.revolutions=0.2"])
    ready = prepare(case)
    sink = open_result_file(ready, tmp_path)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink], stop=lambda: True)
    assert not read_result(sink.partial).response.status.ok
    assert len(modes(case, 2).modes.frequencies) == 2


def test_all_numeric_datasets_have_checksum(seeds):
    """Texts and empty datasets are covered by the digest of the file."""
    with h5py.File(seeds / "small.vtkhdf") as file:
        items = []
        file.visititems(lambda _, item: items.append(item))
        datasets = [item for item in items if isinstance(item, h5py.Dataset)]
        bare = [one for one in datasets if not one.fletcher32]
        assert all(one.dtype.kind == "S" or not one.size for one in bare)
        assert len(datasets) > 2 * len(bare)


def test_file_that_is_open_elsewhere_is_not_called_damaged(seeds):
    with h5py.File(seeds / "small.vtkhdf", "r"), pytest.raises(InputError, match="This process has the file open"):
        read_result(seeds / "small.vtkhdf")
