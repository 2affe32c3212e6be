"""Files: paths in a case, columns of numbers, outputs that must not overwrite others, atomic writes, locks, TOML text.

An atomic write puts the content under a temporary name and renames it once it is complete.
"""

from __future__ import annotations

import os
import re
import struct
import tempfile
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from stat import S_ISREG

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse, require_packages, suggest_name, system_message
from flexcam.core.units import conversion_factor
from flexcam.dynamics import Cause, RunFailedError, Status

_MAX_TEXT_SIZE, _MAX_FILE_SIZE = 1 << 28, 1 << 30  # of files read into memory, bytes
_MAX_PARENTS = 2  # parent folders of a case in which files may lie: ``cases/engine/a.toml`` finds ``meshes/a.msh``
_MAX_LINE_LENGTH = 100  # of an array in TOML, characters
_REMEDY = "use --overwrite, or give another output name"

ALLOWED_FOLDERS_VARIABLE = "FLEXCAM_FILES"
"""Environment variable with further allowed folders, separated as in PATH."""

ABSCISSAS = {"time": ("s", 1.0), "cam angle": ("rad", 1.0), "crank angle": ("rad", 2.0)}
"""SI unit of an abscissa, and its revolutions per camshaft revolution."""

READ_ERRORS = (ArithmeticError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError, struct.error)
"""Exceptions that h5py, numpy and asammdf raise for damaged files."""


def file_size(path: Path) -> int:
    """Return the size of a regular file; devices and pipes are rejected because reading them may never end."""
    status = path.stat()
    if not S_ISREG(status.st_mode):
        raise OSError("it is a folder, a device or a pipe")
    return status.st_size


def read_text(path: Path, encoding: str = "utf-8-sig") -> str:
    """Return the text of a file."""
    size = file_size(path)
    if size > _MAX_TEXT_SIZE:
        raise OSError(f"it has {size} bytes, more than any such file")
    try:
        return path.read_text(encoding=encoding)
    except UnicodeDecodeError as fault:
        line = fault.object.count(b"\n", 0, fault.start) + 1
        raise OSError(f"it is not UTF-8 text: byte 0x{fault.object[fault.start]:02x} in line {line}") from None


def read_source(path: Path, where: str, text: str | None = None, allowed: str = "a readable text file") -> str:
    """Return the text of an input file, or its known text; raise an input error if it cannot be read."""
    try:
        return read_text(path) if text is None else text
    except OSError as fault:
        raise refuse(where, str(path), allowed, system_message(fault)) from None


def write_columns(path: Path, columns: Mapping[str, FloatArray], digits: int = 12, *, every: int = 1) -> None:
    """Write columns of numbers by heading as CSV."""
    rows = np.column_stack(list(columns.values()))[::every]
    with atomic_write_path(path) as draft:
        np.savetxt(draft, rows, fmt=f"%.{digits}g", delimiter=",", header=",".join(columns), comments="")


def read_mdf(path: Path, where: str, names: Sequence[str] = ()) -> dict[str, tuple[str, FloatArray]]:
    """Read channels of an MDF file, all or those named, as `read_columns` does, at the instants of its angle channel.

    Channels of other rates are interpolated; values that are invalid or outside the time of a channel are NaN.
    """
    require_packages(where, path.name, "mdf", "asammdf")
    from asammdf import MDF
    from asammdf.blocks.utils import MdfException

    try:
        file_size(path)
        with MDF(path) as file:
            masters = set(file.masters_db.items())
            known = [name for name, at in file.channels_db.items() if "angle" in name or masters.isdisjoint(at)]
            angle = next((name for name in ("cam angle", "crank angle") if name in known), "")
            if not angle:
                allowed = "a channel 'cam angle' or 'crank angle', with its unit"
                raise refuse(where, f"{path.name} with {', '.join(known)}"[:200], allowed)
            if unknown := [name for name in names if name not in known]:
                near = suggest_name(unknown[0], known)
                raise refuse(where, repr(unknown[0]), f"a channel of {path.name}", "there is no such channel", near)
            signals = {name: file.get(name) for name in (angle, *(names or known))}
            instants = signals[angle].timestamps
            columns: dict[str, tuple[str, FloatArray]] = {}
            for name, signal in signals.items():
                values = np.array(signal.samples, dtype=float)
                if signal.invalidation_bits is not None:
                    values[signal.invalidation_bits] = np.nan
                if name != angle:
                    values = np.interp(instants, signal.timestamps, values, left=np.nan, right=np.nan)
                columns[name] = (signal.unit, values)
            return columns
    except InputError:
        raise
    except (MdfException, *READ_ERRORS) as fault:
        raise refuse(where, str(path), "a readable MDF file", system_message(fault)) from None


def find_abscissa(columns: Mapping[str, tuple[str, FloatArray]], where: str) -> tuple[str, FloatArray]:
    """Return the name of the first abscissa of some columns and its values: cam angles, rad, or times, s."""
    name = next((name for name in ABSCISSAS if name in columns), None)
    if name is None:
        allowed = f"one column {' or '.join(map(repr, ABSCISSAS))}, and at least one measured column"
        remedy = "name it with its unit: crank angle [deg]"
        raise refuse(where, f"the header line {', '.join(columns)}", allowed, "", remedy)
    (si, turns), (unit, values) = ABSCISSAS[name], columns[name]
    if np.isnan(values).any():
        raise refuse(where, f"{name}, with an empty cell", f"a number of {name} in every row")
    return name, values * conversion_factor(unit, si, f"{where}, column {name!r}") / turns


def find_referenced_file(case: Path, name: str) -> Path | None:
    """Return the file named by a string of a case, in any folder; None if the string is not a file name."""
    try:
        path = _folder(case) / name
        return path if path.is_file() else None
    except (OSError, ValueError):  # not a valid file name
        return None


def _folder(case: Path) -> Path:
    """Return the folder to which names in a case are relative: that of the real file."""
    return case.resolve().parent if case.is_symlink() else case.parent


def resolve_file(case: Path, name: str, where: str) -> Path:
    """Return the path of a file named in a case."""
    try:
        folder = _folder(case)
        path = folder / name
        target, home = path.resolve(), folder.resolve()
        size = file_size(path) if path.exists() else 0
    except (OSError, ValueError, RuntimeError) as fault:
        raise refuse(where, repr(name), "the path of a file", system_message(fault)) from None
    extra = [Path(entry).resolve() for entry in os.environ.get(ALLOWED_FOLDERS_VARIABLE, "").split(os.pathsep) if entry]
    above = home.parents[:_MAX_PARENTS][-1] if home.parents else home
    if not any(target.is_relative_to(folder) for folder in [above, *extra]):
        allowed = "a file in the case's folder, up to two folders above it, or below these"
        why = "a case from elsewhere must not open any file"
        raise refuse(where, repr(name), allowed, why, f"move it, or name its folder in {ALLOWED_FOLDERS_VARIABLE}")
    if size > _MAX_FILE_SIZE:
        raise refuse(where, f"{name!r} of {size} bytes", f"up to {_MAX_FILE_SIZE} bytes", "it is read whole")
    return path


def check_writable(where: str, path: Path, *, overwrite: bool, remedy: str = _REMEDY) -> None:
    """Raise an error if an output file exists and may not be overwritten."""
    if path.is_dir():
        raise refuse(where, str(path), "a file", "a folder has this name", "move it, or name another folder")
    if path.exists() and not overwrite:
        raise refuse(where, str(path), "", f"{path} already exists", remedy)
    if path.is_file() or not path.exists():
        check_folder(path.parent)


_FILE_SUFFIXES = frozenset((
    ".h5", ".hdf5", ".vtkhdf", ".csv", ".parquet", ".toml", ".json", ".html", ".svg", ".png", ".pdf", ".pvd", ".vtp",
    ".dxf", ".msh", ".inp",
))  # fmt: skip


def check_folder_name(path: Path) -> Path:
    """Return the path of an output folder; raise an error for a name with the suffix of an output file."""
    if path.suffix.lower() not in _FILE_SUFFIXES or path.exists():
        return path
    allowed, why = "a folder", "the files in it are named after the case"
    raise refuse("folder", str(path), allowed, why, f"name a folder, such as {path.with_suffix('')}")


def create_folder(path: Path) -> Path:
    """Create a folder with its parents if necessary and return it."""
    check_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise refuse("folder", str(path), "a folder that can be made", system_message(fault), "name another") from None
    return path


def check_folder(folder: Path) -> None:
    """Raise an error if a folder, or the nearest one above that exists, takes no files; leave none there."""
    full = folder.absolute()
    existing = next(parent for parent in (full, *full.parents) if os.path.lexists(parent))
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as fault:
        why = system_message(fault) if existing.is_dir() else f"{existing} is not a folder"
        raise refuse("folder", str(folder), "a folder with write permission", why, "name another") from None


@contextmanager
def atomic_write_path(path: Path) -> Generator[Path]:
    """Yield a temporary path, which replaces the target file once the block completes without error.

    Folders that do not exist are created.
    """
    create_folder(path.parent)
    draft = path.with_name(f".flexcam-{os.getpid()}{path.suffix}") if path.is_file() or not path.exists() else path
    try:
        yield draft
        if draft != path:
            draft.replace(path)
    except OSError as fault:
        text = f"{path} could not be written: {fault.strerror or fault}"
        raise RunFailedError(Status(Cause.NOT_SAVED, text, "free space, or name another file or folder")) from None
    finally:
        if draft != path:
            with suppress(OSError):
                draft.unlink(missing_ok=True)


def write_text(path: Path, text: str, *, overwrite: bool = False, where: str = "output") -> Path:
    """Write a text file, such as a table."""
    check_writable(where, path, overwrite=overwrite)
    with atomic_write_path(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


_ARRAY = re.compile(r"^(?P<head>.*)\[\n(?P<body>(?: +[^ \[\]{}].*,\n)+) *\](?P<tail>,?)$", re.MULTILINE)
"""Array in the output of tomli_w, one element per line; nested arrays and tables do not match."""


def format_toml(content: Mapping[str, object]) -> str:
    """Return tables as TOML text, short arrays on one line."""
    import tomli_w

    return _ARRAY.sub(_join_array, tomli_w.dumps(content))


def _join_array(match: re.Match[str]) -> str:
    lines = match["body"].removesuffix("\n").split("\n")  # `splitlines` would also split inside strings
    elements = [line.strip(" ").removesuffix(",") for line in lines]
    line = f"{match['head']}[{', '.join(elements)}]{match['tail']}"
    return line if len(line) <= _MAX_LINE_LENGTH else match[0]


def open_with_lock(path: Path) -> int:
    """Return a descriptor of a file, locked until the process ends; raise BlockingIOError if another has locked it.

    Without file locks (Windows, some network drives) concurrent access is not prevented.
    """
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(file)
            if path.exists() and os.path.samestat(os.fstat(file), path.stat()):
                return file
        except OSError:
            os.close(file)
            raise
        os.close(file)  # another process has renamed the file: the path now names a different file


def _lock(file: int) -> None:
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except (ImportError, OSError):
        return


@contextmanager
def temporary_folder() -> Generator[Path]:
    """Yield a new temporary folder, removed at the end."""
    with tempfile.TemporaryDirectory(prefix="flexcam-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)
