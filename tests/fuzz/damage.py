"""Valid binary seeds, changes of the structure of HDF5 files, and comparison of damaged with valid results."""

from __future__ import annotations

# ruff: noqa: E501 - tables, a row to a line
import dataclasses
import io
import os
import shutil
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from pathlib import Path
from random import Random
from typing import Any

import h5py
import meshio
import numpy as np

from flexcam import read_case
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import solve
from flexcam.io import Result
from flexcam.io.sweep_table import SweepTable

ROOT = Path(__file__).parents[2]


def make_seeds(folder: Path) -> None:
    """Write the seeds unless they exist."""
    if (folder / "done").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    _meshes(folder)
    _result(folder)
    _table(folder)
    angle = np.linspace(0.0, 2.0 * np.pi, 37)[:-1]
    rows = "\n".join(f"{20 * np.cos(a):.6f}, {20 * np.sin(a):.6f}" for a in angle)
    (folder / "profile.csv").write_text(f"x [mm], y [mm]\n{rows}\n", encoding="utf-8")
    (folder / "done").touch()


def _meshes(folder: Path) -> None:
    source = ROOT / "meshes/tayeb-1.msh"
    shutil.copy(source, folder / "ascii22.msh")
    for name in ("ascii41.msh", "binary41.msh"):
        shutil.copy(Path(__file__).parent / "seeds" / name, folder / name)
    meshio.gmsh.read(source).write(folder / "binary22.msh", file_format="gmsh22", binary=True)


def _result(folder: Path) -> None:
    overrides = ["run.revolutions=0.1", "run.steps_per_revolution=400"]
    ready = prepare(read_case(ROOT / "tests/data/inline.toml", overrides))
    sink = open_result_file(ready, folder / "made", overwrite=True)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    shutil.move(sink.path, folder / "small.vtkhdf")


def _table(folder: Path) -> None:
    from flexcam.cli.main import main

    case = ROOT / "tests/data/inline.toml"
    words = [
        "sweep",
        str(case),
        "--set",
        "run.speed=1000:3000:1000rpm",
        "-o",
        str(folder / "made"),
        "--overwrite",
        "--workers",
        "0",
        "--json",
    ]
    with redirect_stdout(io.StringIO()), suppress(SystemExit):
        main(words)
    (made,) = (folder / "made").glob("*.h5")
    shutil.move(made, folder / "small.sweep.h5")


# ---- structure of HDF5 files


def _paths(file: Any) -> list[str]:
    found: list[str] = []
    file.visit(found.append)
    return found


def _link_out(file: Any, path: str, random: Random) -> None:
    del file[path]
    file[path] = h5py.ExternalLink(random.choice(("/etc/passwd", "other.h5", "small.vtkhdf")), "/" + path)


def _link_soft(file: Any, path: str, random: Random) -> None:
    del file[path]
    file[path] = h5py.SoftLink(random.choice(("/nowhere", "/" + path, "/about", "..")))


def _loop(file: Any, path: str, random: Random) -> None:
    del random
    group = file[path] if isinstance(file[path], h5py.Group) else file[path].parent
    group["again"] = file["/"]


def _reference(file: Any, path: str, random: Random) -> None:
    del random
    del file[path]
    file.create_dataset(path, data=np.array([file.ref] * 3, dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)


def _virtual(file: Any, path: str, random: Random) -> None:
    del file[path]
    layout = h5py.VirtualLayout((random.choice((3, 10**9)),), "f8")
    layout[:3] = h5py.VirtualSource(random.choice(("/etc/passwd", "other.h5", ".")), "x", (3,))
    file.create_virtual_dataset(path, layout)


def _external_storage(file: Any, path: str, random: Random) -> None:
    del random
    del file[path]
    file.create_dataset(path, (100,), "u1", external=[("/etc/passwd", 0, 100)])


def _huge(file: Any, path: str, random: Random) -> None:
    del file[path]
    shape = random.choice(((10**12,), (10**6, 10**6), (2**40, 3)))
    file.create_dataset(
        path, shape, "f8", chunks=tuple(min(n, 64) for n in shape), **random.choice(({}, {"compression": "gzip"}))
    )


def _bomb(file: Any, path: str, random: Random) -> None:
    """Replace a dataset by zeros that are compressed a thousandfold."""
    del random
    del file[path]
    file.create_dataset(path, data=np.zeros(1_000_000), compression="gzip", chunks=(250_000,))


def _delete(file: Any, path: str, random: Random) -> None:
    del random
    del file[path]


def _replace_type(file: Any, path: str, random: Random) -> None:
    del file[path]
    data = random.choice(
        (
            np.zeros(3, "i1"),
            np.zeros((2, 2, 2)),
            "text",
            np.zeros(0),
            3.0,
            np.array([b"ab", b"c"]),
            np.array([1 + 2j]),
            np.nan,
        )
    )
    file.create_dataset(path, data=data)


def _replace_by_group(file: Any, path: str, random: Random) -> None:
    del random
    del file[path]
    file.create_group(path)


def _rename(file: Any, path: str, random: Random) -> None:
    file.move(path, random.choice((path + "2", "x", "about/" + path.rpartition("/")[2], "ä" * 50)))


def _change_attribute(file: Any, path: str, random: Random) -> None:
    """Change one attribute through h5py, which updates the checksums, so that only the content is invalid."""
    one = file[path]
    attrs = list(one.attrs)
    if attrs and random.random() < 0.5:
        name = random.choice(attrs)
        value = random.choice(
            (-1, 10**15, "x", np.nan, np.zeros(3), "1e9", np.array(["a", "b"], dtype=h5py.string_dtype()))
        )
        one.attrs[name] = value
    else:
        one.attrs["more"] = 1


Change = Callable[[Any, str, Random], None]

STRUCTURE: tuple[Change, ...] = (
    _link_out, _link_soft, _loop, _reference, _virtual, _external_storage, _huge, _bomb, _delete, _replace_type, _replace_by_group, _rename, _change_attribute,
)  # fmt: skip


def change_structure(seed: Path, path: Path, random: Random, change: Change | None = None) -> None:
    """Write a copy of an HDF5 file with one change of its structure."""
    shutil.copy(seed, path)
    os.chmod(path, 0o600)
    with h5py.File(path, "r+", locking=False) as file:
        where = random.choice(_paths(file))
        try:
            (change or random.choice(STRUCTURE))(file, where, random)
        except (OSError, KeyError, ValueError, TypeError, RuntimeError):
            file.pop(where, None)  # HDF5 itself refuses the change


# ---- comparison of read and written data


def _arrays_differ(one: Any, other: Any, name: str) -> str:
    same = np.shape(one) == np.shape(other) and np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")
    return "" if same else name


def result_differs(read: Result, valid: Any) -> str:
    """Return the name of a quantity in which a damaged result differs from the valid one, or an empty string."""
    one, other = read.response, valid.response
    pairs = {
        "time": (one.time, other.time), "angle": (one.angle, other.angle), "field_time": (one.field_time, other.field_time),
        "field_angle": (one.field_angle, other.field_angle), "nodes": (read.mesh.nodes, valid.mesh.nodes),
        **{f"probes.{k}": (getattr(one.probes, k), getattr(other.probes, k)) for k in ("displacement", "velocity", "acceleration")},
        **{f"fields.{k}": (getattr(one.fields, k), getattr(other.fields, k)) for k in ("displacement", "velocity", "acceleration")},
        **{f"recovered.{k}": (read.recovered.get(k), v) for k, v in valid.recovered.items()},
        **{f"still.{k}": (read.constant.get(k), v) for k, v in valid.constant.items()},
    }  # fmt: skip
    for name, (a, b) in pairs.items():
        if _arrays_differ(a, b, name):
            return name
    for name, (a, b) in {
        "outline": (one.outline, other.outline), "status": (one.status, other.status), "about": (dict(read.about), dict(valid.about)),
        "stats": (dataclasses.asdict(one.stats), dataclasses.asdict(other.stats)), "channels": (list(one.channels), list(other.channels)),
        "lines": ({k: v.tolist() for k, v in read.mesh.lines.items()}, {k: v.tolist() for k, v in valid.mesh.lines.items()}),
        "points": ({k: v.tolist() for k, v in read.mesh.points.items()}, {k: v.tolist() for k, v in valid.mesh.points.items()}),
    }.items():  # fmt: skip
        if a != b:
            return name
    return next((k for k, v in other.channels.items() if _arrays_differ(one.channels[k], v, k)), "")


def table_differs(read: SweepTable, valid: Any) -> str:
    """Return the name of a quantity in which a damaged table differs from the valid one, or an empty string."""
    for name in ("units", "statuses", "shape", "about"):
        if getattr(read, name) != getattr(valid, name):
            return name
    if [(c.name, c.unit) for c in read.inputs] != [(c.name, c.unit) for c in valid.inputs]:
        return "inputs"
    if list(read.scalars) != list(valid.scalars):
        return "scalars"
    pairs = [(c.name, c.values, d.values) for c, d in zip(read.inputs, valid.inputs, strict=True)]
    pairs += [(k, read.scalars[k], v) for k, v in valid.scalars.items()]
    return next((name for name, a, b in pairs if list(map(str, a)) != list(map(str, b))), "")
