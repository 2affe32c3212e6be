"""How large a result file will be."""

from __future__ import annotations

import math

from flexcam.fem import Mesh
from flexcam.io.geometry import RECOVERED
from flexcam.io.growing import chunk_rows
from flexcam.io.vtkhdf import SERIES, VECTORS
from flexcam.response import Outline, SaveAt

_NUMBER, _CHUNK, _DATASET = 8, 80, 2900
"""Bytes of a number, of a chunk's checksum and entry in the index, of a dataset's head and the first of its index."""

_ABOUT = 125_000
"""Bytes of the case, of what else is kept as text, and of the mesh for what does not grow with it."""

_STILL = 24
"""Numbers of a point that do not change, such as its place and its axes."""


def result_bytes(outline: Outline, mesh: Mesh, save: SaveAt, steps: int) -> int:
    """Return the size of the result file of a run."""
    rows, fields = steps + 1, -(-steps // save.field_every) + 1
    widths = [1, 1, *(len(parts) for _, parts in outline.probes for _ in SERIES), *(1 for _ in outline.channels)]
    points, together = points_drawn(mesh), max(save.block // save.field_every, 1)
    vectors = [*(3 for _ in VECTORS), *(width for _, width in RECOVERED.values())]
    size = sum(_growing(rows, save.block, width) for width in widths)
    size += sum(_growing(fields * points, together * points, width) for width in vectors)
    size += 4 * _growing(fields, together, 1)  # times, angles, parts, offsets
    return size + _NUMBER * _STILL * points + _ABOUT


def points_drawn(mesh: Mesh) -> int:
    """Return at how many points fields are drawn: those of every member, and the nodes on none."""
    return sum(len(line) for line in mesh.lines.values()) + int((~mesh.on_members()).sum())


def _growing(rows: int, block: int, width: int) -> int:
    """Return the bytes of a dataset whose last chunk is stored whole."""
    chunk = chunk_rows(block, width)
    return math.ceil(rows / chunk) * (chunk * width * _NUMBER + _CHUNK) + _DATASET
