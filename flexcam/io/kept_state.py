"""The checkpoint in a partial result: one dataset of bytes, arrays by name as numpy writes them, nothing pickled."""

from __future__ import annotations

import zlib
from io import BytesIO
from typing import Any

import numpy as np

from flexcam.checkpoint import Checkpoint
from flexcam.io.sealed import keep_sum
from flexcam.io.sound import taken

CHECKPOINT = "checkpoint"
"""Name of the dataset."""

_STEPS, _PROBLEM = "steps", "problem"
_CHUNK = 4096


def make_checkpoint(file: Any) -> None:  # noqa: ANN401 - h5py has no types
    """Make the place of the checkpoint in a new result file, empty."""
    file.create_dataset(CHECKPOINT, (0,), "u1", maxshape=(None,), chunks=(_CHUNK,), fletcher32=True)
    keep_sum(file[CHECKPOINT], zlib.crc32(b""))


def write_checkpoint(file: Any, checkpoint: Checkpoint) -> None:  # noqa: ANN401
    """Write a checkpoint into an open result file, in the place of an earlier one."""
    packed = BytesIO()
    own = {_STEPS: np.array(checkpoint.steps), _PROBLEM: np.array(checkpoint.problem)}
    arrays: dict[str, Any] = {**checkpoint.arrays, **own}
    np.savez(packed, **arrays)
    content = np.frombuffer(packed.getvalue(), dtype=np.uint8)
    file[CHECKPOINT].resize((len(content),))
    file[CHECKPOINT][:] = content
    keep_sum(file[CHECKPOINT], zlib.crc32(content.data))


def read_checkpoint(file: Any) -> Checkpoint | None:  # noqa: ANN401
    """Return the checkpoint of an open result file."""
    if CHECKPOINT not in file or not len(file[CHECKPOINT]):
        return None
    with np.load(BytesIO(taken(file[CHECKPOINT]).tobytes()), allow_pickle=False) as packed:
        arrays: dict[str, Any] = dict(packed.items())
    return Checkpoint(int(arrays.pop(_STEPS)), str(arrays.pop(_PROBLEM)), arrays)


def drop_checkpoint(file: Any) -> None:  # noqa: ANN401
    """Take the checkpoint out of an open result file: a complete run needs none."""
    del file[CHECKPOINT]
