"""The checkpoint in a partial result: one dataset of bytes, arrays by name as numpy writes them, nothing pickled."""

from __future__ import annotations

import zlib
from io import BytesIO
from typing import Any

import numpy as np

from flexcam.checkpoint import Checkpoint
from flexcam.io.sealed import keep_sum
from flexcam.io.texts import note, noted

_NAME = "checkpoint"
_CHUNK = 4096


def write_checkpoint(file: Any, checkpoint: Checkpoint) -> None:  # noqa: ANN401 - h5py has no types
    """Write a checkpoint into an open result file, in the place of an earlier one.

    Parameters
    ----------
    file
        Of h5py.
    checkpoint
        As it stands behind the last block.
    """
    packed = BytesIO()
    arrays: dict[str, Any] = dict(checkpoint.arrays)
    np.savez(packed, **arrays)
    content = np.frombuffer(packed.getvalue(), dtype=np.uint8)
    if _NAME not in file:
        file.create_dataset(_NAME, (0,), "u1", maxshape=(None,), chunks=(_CHUNK,), fletcher32=True)
    kept = file[_NAME]
    kept.resize((len(content),))
    kept[:] = content
    kept.attrs["steps"] = checkpoint.steps
    note(kept, "problem", checkpoint.problem)
    keep_sum(kept, zlib.crc32(content.data))


def read_checkpoint(file: Any) -> Checkpoint | None:  # noqa: ANN401
    """Return the checkpoint of an open result file.

    Parameters
    ----------
    file
        Of h5py.

    Returns
    -------
    Checkpoint or None
        None where it holds none.

    Raises
    ------
    OSError, ValueError
        If it is damaged.
    """
    if _NAME not in file:
        return None
    kept = file[_NAME]
    with np.load(BytesIO(kept[()].tobytes()), allow_pickle=False) as packed:
        arrays = dict(packed.items())
    return Checkpoint(int(kept.attrs["steps"]), noted(kept, "problem"), arrays)


def drop_checkpoint(file: Any) -> None:  # noqa: ANN401
    """Take the checkpoint out of an open result file: a complete run needs none.

    Parameters
    ----------
    file
        Of h5py.
    """
    if _NAME in file:
        del file[_NAME]
