"""Files that refer to other files, exhaust memory or contain code are refused before they are read."""

import io
import os
import pickle
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, read_mesh, read_result
from flexcam.analysis.run import open_result_file
from flexcam.case.reader import case_from_result
from flexcam.dynamics import solve
from flexcam.io import open_hdf5, write_digest
from flexcam.io.sweep_table import read_table
from flexcam.report.content import load_subject
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def result_path(tmp_path_factory):
    """Return the path of a small complete result."""
    ready = prepare(read_case(ROOT / "tests/data/inline.toml", ["run.revolutions=0.05"]))
    sink = open_result_file(ready, tmp_path_factory.mktemp("sound"))
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    return sink.path


def reference(file):
    file.create_dataset("x", data=np.array([file.ref], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)


def region(file):
    file["mesh/nodes"].attrs["x"] = file["mesh/nodes"].regionref[0:1]


def virtual(file):
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource("secret.h5", "x", (3,))
    file.create_virtual_dataset("x", layout)


def external_storage(file):
    file.create_dataset("x", (4,), "u1", external=[("/etc/passwd", 0, 4)])


def external_link(file):
    file["x"] = h5py.ExternalLink("secret.h5", "/x")


def soft_link(file):
    file["x"] = h5py.SoftLink("/about")


def loop(file):
    file["mesh/x"] = file["/"]


def huge_dataset(file):
    file.create_dataset("x", (10**13,), "f8", chunks=(1000,))


def compressed_zeros(file):
    file.create_dataset("x", data=np.zeros(60_000_000, "f4")[:1], maxshape=(None,), chunks=(1000,), compression="gzip")
    file["x"].resize((10**11,))


def plug_in(file):
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((4,))
    made.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, (3,))
    h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((4,)), made)


def heap(file):
    file.create_dataset("x", data="text", dtype=h5py.string_dtype())


def heap_attribute(file):
    file["mesh"].attrs["x"] = "text"


def compound(file):
    file.create_dataset("x", data=np.zeros(3, dtype=[("a", "f8"), ("b", "i4")]))


HOSTILE = {
    "an object reference": (reference, "references"), "a region reference": (region, "reference"),
    "a virtual dataset": (virtual, "another file"), "external storage": (external_storage, "another file"),
    "an external link": (external_link, "external link"), "a soft link": (soft_link, "soft link"),
    "a group that contains itself": (loop, "itself"), "a size that no file has": (huge_dataset, "bytes declared"),
    "zeros, compressed": (compressed_zeros, "bytes declared"), "a filter that is a plug-in": (plug_in, "filter"),
    "a text on the heap": (heap, "fixed length"), "an attribute on the heap": (heap_attribute, "fixed length"),
    "a record": (compound, "values of type"),
}  # fmt: skip


@pytest.mark.parametrize("what", mostly_slow(HOSTILE, 2))
def test_hdf5_with_references_or_huge_data_is_refused(what, result_path, tmp_path, tried):
    make, expected = HOSTILE[what]
    path = tmp_path / "hostile.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(tmp_path / "secret.h5", "w") as secret:
        secret["x"] = np.arange(3.0)
    with h5py.File(path, "r+") as file:
        make(file)
    for read in (read_result, read_table):
        with pytest.raises(InputError, match=expected) as refusal:
            read(path)
        assert str(path) in str(refusal.value)
    tried("hostile", f"HDF5 with {what}", 2, "refused before reading")


CONTENT_CHANGES = {
    "short integers": lambda one: one[()].astype("i1"),
    "large integers": lambda one: np.full(one.shape, 2**63 + 5, "u8"),
    "texts": lambda one: np.full(one.shape, b"abc"), "not finite": lambda one: np.full(one.shape, np.nan),
    "beyond any number": lambda one: np.full(one.shape, 1e308), "one number": lambda one: np.array(1.0),
    "another rank": lambda one: np.ones((2, 2, 2)), "nothing": lambda one: np.zeros(0),
    "another order of bytes": lambda one: one[()].astype(one.dtype.newbyteorder(">")),
}  # fmt: skip
NUMBERS = (
    "history/time", "history/cam_angle", "history/channels/cams.intake.deflection", "history/probes/valve/displacement",
    "fields/cam_angle", "mesh/nodes", "VTKHDF/PointData/displacement", "VTKHDF/PointData/axis_x",
    "VTKHDF/PointData/node", "VTKHDF/PointData/stress_axial", "VTKHDF/Lines/Offsets",
)  # fmt: skip


@pytest.mark.parametrize(
    ("what", "name"),
    [(what, name) for i, what in enumerate(CONTENT_CHANGES) for j, name in enumerate(NUMBERS) if (i + j) % 7 == 0],
)
def test_data_of_wrong_type_shape_or_size_is_refused(what, name, result_path, tmp_path):
    """The checksum is valid, as in a file of another program."""
    path = tmp_path / "foreign.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(path, "r+") as file:
        changed = CONTENT_CHANGES[what](file[name])
        del file[name]
        file[name] = changed
        write_digest(file)
    with pytest.raises(InputError, match=str(path)) as refusal:
        read_result(path)
    assert len(refusal.value.faults) == 1


@pytest.mark.parametrize("name", ["history/time", "VTKHDF/Steps/Values", "mesh/nodes", "VTKHDF/Lines/Offsets"])
def test_non_increasing_data_is_refused(name, result_path, tmp_path):
    path = tmp_path / "foreign.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(path, "r+") as file:
        file[name][...] = 0
        write_digest(file)
    with pytest.raises(InputError, match=str(path)) as refusal:
        read_result(path)
    assert len(refusal.value.faults) == 1


@pytest.mark.parametrize("name", ["case", "case_file", "overrides", "resolved"])
def test_result_without_case_is_refused(name, result_path, tmp_path):
    path = tmp_path / "foreign.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(path, "r+") as file:
        del file["about"][name]
        write_digest(file)
    with pytest.raises(InputError, match=f"nothing about '{name}'"):
        read_result(path)


def test_result_with_mesh_of_another_case_is_refused(result_path, tmp_path):
    """Found by the fuzzer: a renamed point with a valid checksum."""
    path = tmp_path / "foreign.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(path, "r+") as file:
        file.move("mesh/points/front", "x")
        write_digest(file)
    with pytest.raises(InputError, match="a mesh without front"):
        case_from_result(read_result(path))


def test_report_does_not_rerun_excessively_long_case(result_path, tmp_path):
    path = tmp_path / "foreign.vtkhdf"
    path.write_bytes(result_path.read_bytes())
    with h5py.File(path, "r+") as file:
        del file["about/overrides"]
        file["about/overrides"] = np.bytes_(b'["run.revolutions=1e11"]')
        write_digest(file)
    subject = load_subject(path)
    assert subject.rigid is None
    assert any("comparison with a rigid train" in one and "memory" in one for one in subject.lacking)


def test_chunk_shorter_than_checksum_is_refused(tmp_path):
    """HDF5 subtracts the length of the checksum from that of the chunk and reads out of bounds."""
    path = tmp_path / "short.vtkhdf"
    with h5py.File(path, "w") as file:
        made = file.create_dataset("x", (4,), "f8", maxshape=(None,), chunks=(4,), fletcher32=True)
        made.id.write_direct_chunk((0,), b"ab")
    for read in (read_result, read_table):
        with pytest.raises(InputError, match="shorter than its checksum"):
            read(path)


def test_valid_result_is_read(result_path):
    """The dimension scales of flexcam are references that no reader follows."""
    with open_hdf5(result_path, "result", "a result") as file:
        assert "DIMENSION_LIST" in file["history/cam_angle"].attrs
    assert read_result(result_path).response.status.ok


XML_BOMB = """<?xml version="1.0"?><!DOCTYPE VTKFile [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;"><!ENTITY d SYSTEM "file:///etc/passwd">]><VTKFile>&c;&d;</VTKFile>"""


@pytest.mark.parametrize("name", ["bomb.vtu", "bomb.xdmf", "bomb.pvd", "bomb.vtp", "bomb.dae", "bomb.msh"])
def test_xml_files_are_refused(name, tmp_path, tried):
    (tmp_path / name).write_text(XML_BOMB)
    with pytest.raises(InputError):
        read_mesh(tmp_path / name)
    with pytest.raises(InputError):
        read_result(tmp_path / name)
    tried("hostile", f"XML with entities in entities, {name}", 2, "refused, not parsed")


READERS = """
import sys
from pathlib import Path
from flexcam import InputError, read_case, read_mesh, read_result, prepare
prepare(read_case(sys.argv[1]))
read_mesh(Path(sys.argv[2]))
read_result(sys.argv[3])
print(sorted({"pickle", "yaml", "defusedxml", "meshio", "lxml.etree"} & set(sys.modules)))
"""


def test_readers_of_other_formats_are_not_imported(result_path):
    """The thirty readers of meshio, some of them for XML, are not imported; numpy itself imports pickle."""
    words = [sys.executable, "-c", READERS, ROOT / "tests/data/inline.toml", ROOT / "meshes/tayeb-3.msh", result_path]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=60, check=True)
    assert set(eval(done.stdout)) <= {"pickle"}  # noqa: S307 - our own list


class Bomb:
    def __reduce__(self):
        return os.mkdir, ("exploded",)


def test_pickled_checkpoint_is_refused(result_path, tmp_path, monkeypatch, tried):
    """The checkpoint of a partial result consists of arrays; one of objects is refused."""
    from flexcam.io.result_writer import read_checkpoint

    monkeypatch.chdir(tmp_path)
    packed = io.BytesIO()
    np.savez(packed, state=np.array([Bomb()], dtype=object))
    assert pickle.dumps(Bomb())
    with h5py.File(tmp_path / "partial.vtkhdf", "w") as file:
        file["checkpoint"] = np.frombuffer(packed.getvalue(), dtype=np.uint8)
        with pytest.raises(ValueError, match="allow_pickle"):
            read_checkpoint(file)
    assert not (tmp_path / "exploded").exists()
    tried("hostile", "a checkpoint of pickled objects", 1, "refused, not unpickled")


OUTSIDE = {
    "mesh": ('[nodes]', 'mesh = "{}"\n[nodes]'),
    "law": ('law = "shm"', 'law = "{}"'),
    "lift_table": ('law = "shm"', 'lift_table = "{}"'),
    "start": ('start = "rest"', 'start = {{ result = "{}" }}'),
}  # fmt: skip


@pytest.mark.parametrize("key", OUTSIDE)
@pytest.mark.parametrize("where", ["absolute", "three up", "link"])
def test_case_opens_only_files_near_it(key, where, tmp_path, monkeypatch, tried):
    """A case opens no file outside its folder and the two folders above, unless FLEXCAM_FILES allows it."""
    ending = {"mesh": ".msh", "law": ".toml", "lift_table": ".csv", "start": ".vtkhdf"}[key]
    folder = tmp_path / "a/b/c/d"
    folder.mkdir(parents=True)
    secret = tmp_path / f"secret{ending}"
    secret.write_text("secret")
    (folder / f"link{ending}").symlink_to(secret)
    name = {"absolute": str(secret), "three up": f"../../../../secret{ending}", "link": f"link{ending}"}[where]
    old, new = OUTSIDE[key]
    text = (ROOT / "tests/data/inline.toml").read_text(encoding="utf-8").replace(old, new.format(name), 1)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    monkeypatch.setenv("FLEXCAM_FILES", "")
    with pytest.raises(InputError, match="two folders above") as refusal:
        prepare(read_case(folder / "case.toml"))
    assert "secret'" not in str(refusal.value).replace(secret.name, "")
    monkeypatch.setenv("FLEXCAM_FILES", str(tmp_path))
    with pytest.raises(InputError) as refusal:  # access is allowed, but the content is invalid
        prepare(read_case(folder / "case.toml"))
    assert "two folders above" not in str(refusal.value)
    tried("hostile", f"{key} of a case: {where}", 2, "refused before opening; opened if FLEXCAM_FILES allows it")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no such files on Windows")
def test_pipe_instead_of_table_is_refused(tmp_path, tried):
    """Reading a pipe would wait forever."""
    os.mkfifo(tmp_path / "pipe.csv")
    text = (
        (ROOT / "tests/data/inline.toml").read_text(encoding="utf-8").replace('law = "shm"', 'lift_table = "pipe.csv"')
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="It is a folder, a device or a pipe"):
        read_case(tmp_path / "case.toml")
    tried("hostile", "a pipe instead of a table", 1, "refused before opening")
