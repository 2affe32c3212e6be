"""Mode shapes for ParaView: one animated data set and one static data set with all modes."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.cams import KINDS, HarmonicLift, Law
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.io.atomic_write import atomic_write_path
from flexcam.io.exports import ExportFrame, write_collection, write_text, write_vtp
from flexcam.io.integrity import write_digest
from flexcam.io.paths import check_writable
from flexcam.io.text_files import format_toml, write_strings
from flexcam.io.vtk_groups import Geometry, VtkGroup, constant_data

FRAMES_PER_PERIOD = 24
"""Frames per period of the animation."""

_DRAWN_AMPLITUDE = 0.05
"""Maximum translation of a drawn shape relative to the model size, suited to Warp By Vector with scale 1."""


def write_modes(
    path: Path, geometry: Geometry, frequencies: FloatArray, shapes: FloatArray, *, overwrite: bool = False
) -> list[Path]:
    """Write modes as ``NAME.vtkhdf`` (animated), ``NAME.pvd`` (the same for ParaView 5.11) and ``NAME.vtp`` (static).

    Time is the phase of one period, 0 to 1. Every mode is a separate point vector, such as ``mode_01_67.1Hz``: select
    it in Warp By Vector and press play. The maximum translation of a drawn shape is 5 % of the model size.
    """
    still_path, collection = path.with_suffix(".vtp"), path.with_suffix(".pvd")
    for target in (path, still_path, collection):
        check_writable("modes", target, overwrite=overwrite)
    drawn = _scaled_shapes(geometry, frequencies, shapes)
    phase = np.arange(FRAMES_PER_PERIOD) / FRAMES_PER_PERIOD
    swing = np.cos(2.0 * np.pi * phase)
    still = constant_data(geometry)
    held = io.BytesIO()  # small; h5py does not handle a full disk safely
    with h5py.File(held, "w") as opened:
        file: Any = opened
        group = VtkGroup(file, geometry, dict.fromkeys(drawn, ("m", 3)), still, FRAMES_PER_PERIOD)
        group.append({name: swing[:, None, None] * shape for name, shape in drawn.items()}, FRAMES_PER_PERIOD)
        group.count(FRAMES_PER_PERIOD)
        group.write_times(phase)
        write_strings(
            file.create_group("about"), {"kind": "modes", "frequencies_hz": " ".join(f"{f:.9g}" for f in frequencies)}
        )
        for one in group.growing_datasets:
            one.write_checksum()
        write_digest(file)
    with atomic_write_path(path) as draft:
        draft.write_bytes(held.getvalue())
    constant = {name: values for name, (values, _) in still.items()}
    write_vtp(still_path, ExportFrame(geometry.mesh, geometry.node, {**constant, **drawn}))
    frames = (
        ExportFrame(geometry.mesh, geometry.node, {**constant, **{n: s * d for n, d in drawn.items()}}) for s in swing
    )
    return [path, still_path, *write_collection(collection, phase, frames)]


def _scaled_shapes(geometry: Geometry, frequencies: FloatArray, shapes: FloatArray) -> dict[str, FloatArray]:
    size = geometry.mesh.extent
    drawn: dict[str, FloatArray] = {}
    nodal = geometry.dofs.nodal_modes(shapes.T, size)[:, geometry.node, :3]
    for i, (frequency, moved) in enumerate(zip(frequencies, nodal, strict=True), start=1):
        largest = float(np.linalg.norm(moved, axis=1).max())
        scale = (
            _DRAWN_AMPLITUDE * size / largest if largest > 0.0 else 0.0
        )  # pure torsion or an internal mode moves no point
        drawn[f"mode_{i:02d}_{frequency:.1f}Hz"] = scale * moved
    return drawn


def write_law(law: Law, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a law as a file for a case: ``law = "NAME.toml"``."""
    names = [name for name, kind in KINDS.items() if kind is type(law)]
    if not names or not is_dataclass(law):
        raise refuse("law", type(law).__name__, f"a law of the kinds {', '.join(KINDS)}")
    table = {key: value for key, value in asdict(law).items() if value is not None}
    return _write(path, {"format": 1, "law": {"id": names[0], **table}, "about": dict(about)}, overwrite=overwrite)


def write_lift(lift: HarmonicLift, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a harmonic lift as a file for a case: ``lift_table = "NAME.toml"``."""
    return _write(path, {"format": 1, "lift": asdict(lift), "about": dict(about)}, overwrite=overwrite)


def _write(path: Path, content: Mapping[str, object], *, overwrite: bool) -> Path:
    if path.suffix != ".toml":
        raise refuse("output", str(path), "a name that ends in .toml", "so a case tells it from a name of a law")
    return write_text(path, format_toml(content), overwrite=overwrite)
