"""Export of results and modes: VTK PolyData XML (base64), ParaView collections and macros, CSV."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.dynamics import Response
from flexcam.fem.mesh import Mesh
from flexcam.io.files import atomic_write_path, check_writable, create_folder, write_columns, write_text
from flexcam.io.hdf5 import write_digest, write_texts
from flexcam.io.result_reader import Result
from flexcam.io.result_schema import ABOUT, FIELDS, MODES_FREQUENCIES, MODES_KIND, NODE, RADIUS, VECTORS
from flexcam.io.vtk import Data, Geometry, VtkGroup, constant_data, write_polylines, write_vtk

CAM_ANGLE = "cam_angle_deg"
"""Field data of every frame: the cam angle, deg."""


def write_pvd(
    result: Result, path: Path, *, every: int = 1, fields: Sequence[str] | None = None, overwrite: bool = False
) -> list[Path]:
    """Write a result as a ParaView collection."""
    if every < 1:
        raise refuse("every", every, "a whole number, at least 1")
    check_writable("export", path, overwrite=overwrite)
    node = result.constant[NODE].astype(np.intp)
    known = {**{name: result.field(name)[:, node] for name in VECTORS}, **result.recovered}
    for name in fields or ():
        if name not in known:
            raise refuse("fields", repr(name), ", ".join(known), remedy=suggest_name(name, known))
    moving = {name: known[name] for name in fields or known}
    instants = range(0, len(result.response.field_time), every)
    degrees = np.degrees(result.response.field_angle).tolist()
    frames = (({**{n: v[i] for n, v in moving.items()}, **result.constant}, {CAM_ANGLE: degrees[i]}) for i in instants)
    return _write_frames(path, result.mesh, node, result.response.field_time[::every], frames)


def _write_frames(
    path: Path, mesh: Mesh, node: IntArray, times: FloatArray, frames: Iterable[tuple[Data, dict[str, float]]]
) -> list[Path]:
    """Write the point data and global values of instants as ``.vtp`` files, and a ``.pvd`` file that lists them."""
    folder = create_folder(path.with_suffix(""))
    files = [folder / f"{path.stem}_{i:06d}.vtp" for i in range(len(times))]
    for piece, (data, field_data) in zip(files, frames, strict=True):
        _write_vtp(piece, mesh, node, data, field_data)
    write_collection(path, times, files)
    return [path, *files]


def write_collection(path: Path, times: FloatArray, files: Sequence[Path]) -> None:
    """Write a ``.pvd`` file that lists a file per instant; each lies in a folder next to it."""
    from xml.sax.saxutils import quoteattr  # imports urllib

    names = [quoteattr(f"{file.parent.name}/{file.name}") for file in files]
    instants = zip(times.tolist(), names, strict=True)
    lines = [f'    <DataSet timestep="{time!r}" part="0" file={name}/>' for time, name in instants]
    write_vtk(path, "Collection", lines)


def _write_vtp(path: Path, mesh: Mesh, node: IntArray, data: Data, field_data: Mapping[str, float]) -> None:
    """Write one instant: a polyline per member and a vertex per movable node without a member."""
    lengths = [len(line) for line in mesh.lines.values()]
    members = np.concatenate([np.full(len(node) - sum(lengths), -1), np.arange(len(lengths))])
    values = {name: np.array([value]) for name, value in field_data.items()}
    write_polylines(path, mesh.nodes[node], lengths, point_data=data, cell_data={"member": members}, field_data=values)


_MACRO = '''\
"""A result of flexcam in ParaView (5.11 or newer).

    paraview --script=MACRO             opens it; MACRO is this file
    pvbatch MACRO picture.png 540       draws it at a cam angle (without a display: xvfb-run -a pvbatch ...)

Or in ParaView: Macros, Import new macro. Change the values below and run it again.
"""

import os
import sys

from paraview.simple import *

SCALE = 1.0  # of the displacements; the bending of a shaft is seen from some hundred on
COLOUR = {colour!r}  # any point array
UNITS = {units!r}
COLLECTION = {collection!r}
WRITTEN_IN = {folder!r}  # where to look if the macro was moved away from its collection
DEGREES = {degrees}  # cam angle of every instant

paraview.simple._DisableFirstRenderCameraReset()
own = globals().get("__file__")  # the window of ParaView does not set it
folders = [os.path.dirname(os.path.abspath(own))] if own else []
paths = [os.path.join(folder, COLLECTION) for folder in [*folders, os.getcwd(), WRITTEN_IN]]
source = PVDReader(registrationName={name!r}, FileName=next(filter(os.path.exists, paths), paths[-1]))
source.UpdatePipeline()

warped = WarpByVector(registrationName="moved", Input=source)
warped.Vectors = ["POINTS", {vector!r}]
warped.ScaleFactor = SCALE

tubes = Tube(registrationName="members", Input=warped)
tubes.Scalars = ["POINTS", {radius!r}]
tubes.VaryRadius = "By Absolute Scalar"
tubes.NumberofSides = 24

view = GetActiveViewOrCreate("RenderView")
shown = Show(tubes, view)
ColorBy(shown, ("POINTS", COLOUR))
times = list(source.TimestepValues)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
given = sys.argv[1:] if sys.argv[1:] and sys.argv[1].endswith(".png") else []
angle = float(given[1]) if len(given) > 1 else DEGREES[0]
nearest = min(range(len(times)), key=lambda i: abs(DEGREES[i] - angle))
scene.AnimationTime = view.ViewTime = times[nearest]
shown.RescaleTransferFunctionToDataRangeOverTime()
shown.SetScalarBarVisibility(view, True)

angle = AnnotateGlobalData(registrationName="cam angle", Input=source)
angle.SelectArrays = {angle!r}
angle.Prefix = "cam angle "
angle.Suffix = " deg"
angle.Format = "%7.1f"
words = Show(angle, view)
words.Color = [0.0, 0.0, 0.0]
words.FontSize = 18

view.UseColorPaletteForBackground = 0
view.Background = [1.0, 1.0, 1.0]
view.OrientationAxesVisibility = 1
bar = GetScalarBar(GetColorTransferFunction(COLOUR), view)
bar.Title = ", ".join([COLOUR, *filter(None, [UNITS.get(COLOUR)])])
bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [1.0, 0.5, 1.6], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]
view.ResetCamera()
Render(view)
if given:
    view.ViewSize = [1024, 768]
    SaveScreenshot(given[0], view)
'''


def write_macro(collection: Path, fields: Sequence[str], degrees: Sequence[float], *, overwrite: bool = False) -> Path:
    """Write the macro of an exported collection as ``NAME.paraview.py`` in its folder."""
    colour = "stress_von_mises" if "stress_von_mises" in fields else fields[0]
    text = _MACRO.format(
        name=collection.stem, colour=colour, collection=collection.name,
        folder=str(collection.parent.resolve()), angle=CAM_ANGLE,
        degrees=[round(angle, 6) for angle in degrees], units={name: unit for name, (unit, _) in FIELDS.items()},
        vector=next(iter(VECTORS)), radius=RADIUS,
    )  # fmt: skip
    return write_text(macro_path(collection), text, overwrite=overwrite, where="export")


def macro_path(collection: Path) -> Path:
    """Return the path of the macro of a collection."""
    return collection.with_name(f"{collection.stem}.paraview.py")


def write_csv(
    response: Response, path: Path, *, probes: Sequence[str] | None = None, every: int = 1, overwrite: bool = False
) -> Path:
    """Write time, cam angle, probe histories and channels as CSV, one row per step."""
    if every < 1:
        raise refuse("every", every, "a whole number, at least 1")
    check_writable("export", path, overwrite=overwrite)
    columns: dict[str, FloatArray] = {"time [s]": response.time, "cam angle [deg]": np.degrees(response.angle)}
    columns |= {f"{name} {series} [{unit}]": column for name, series, unit, column in response.motions(probes)}
    units = dict(response.outline.channels)
    columns.update({f"{name} [{units[name]}]": values for name, values in response.channels.items()})
    write_columns(path, columns, digits=17, every=every)
    return path


def energies(response: Response) -> dict[str, FloatArray]:
    """Return the histories of the energies of a run by name, J."""
    return {name.removeprefix("energy."): v for name, v in response.channels.items() if name.startswith("energy.")}


FRAMES_PER_PERIOD = 24
"""Frames per period of the animation."""

_DRAWN_AMPLITUDE = 0.05  # maximum translation of a drawn shape relative to the model size


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
    size = geometry.mesh.extent
    drawn: dict[str, FloatArray] = {}
    nodal = geometry.dofs.nodal_modes(shapes.T, size)[:, geometry.node, :3]
    for i, (frequency, translations) in enumerate(zip(frequencies, nodal, strict=True), start=1):
        maximum = float(np.linalg.norm(translations, axis=1).max())
        # Pure torsion or an internal mode moves no point.
        scale = _DRAWN_AMPLITUDE * size / maximum if maximum > 0.0 else 0.0
        drawn[f"mode_{i:02d}_{frequency:.1f}Hz"] = scale * translations
    phase = np.arange(FRAMES_PER_PERIOD) / FRAMES_PER_PERIOD
    swing = np.cos(2.0 * np.pi * phase)
    still = constant_data(geometry)
    content = io.BytesIO()  # small; h5py does not handle a full disk safely
    with h5py.File(content, "w") as opened:
        file: Any = opened
        group = VtkGroup(file, geometry, dict.fromkeys(drawn, ("m", 3)), still, FRAMES_PER_PERIOD)
        group.append({name: swing[:, None, None] * shape for name, shape in drawn.items()}, FRAMES_PER_PERIOD)
        group.count(phase)
        about = {MODES_KIND: "modes", MODES_FREQUENCIES: " ".join(f"{f:.9g}" for f in frequencies)}
        write_texts(file.create_group(ABOUT), about)
        write_digest(file)
    with atomic_write_path(path) as draft:
        draft.write_bytes(content.getvalue())
    constant = {name: values for name, (values, _) in still.items()}
    _write_vtp(still_path, geometry.mesh, geometry.node, {**constant, **drawn}, {})
    frames = (({**constant, **{n: s * d for n, d in drawn.items()}}, dict[str, float]()) for s in swing)
    return [path, still_path, *_write_frames(collection, geometry.mesh, geometry.node, phase, frames)]
