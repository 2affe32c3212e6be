"""A macro for ParaView, 5.11 and newer: opens an exported collection warped, as tubes, with the cam angle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flexcam.io.geometry import RECOVERED
from flexcam.io.pvd import CAM_ANGLE
from flexcam.io.target import free_to_write
from flexcam.io.vtkhdf import VECTORS
from flexcam.io.whole import whole

_UNITS = {name: unit for name, (*_, unit) in VECTORS.items()} | {name: unit for name, (unit, _) in RECOVERED.items()}

_MACRO = '''\
"""A result of flexcam in ParaView (5.11 or newer).

    paraview --script=MACRO             opens it; MACRO is this file
    pvbatch MACRO picture.png 540       draws it at a cam angle (without a display: xvfb-run -a pvbatch ...)

Or in ParaView: Macros, Import new macro. Change what stands here and run it again.
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
own = globals().get("__file__")  # ParaView's window does not tell
folders = [os.path.dirname(os.path.abspath(own))] if own else []
paths = [os.path.join(folder, COLLECTION) for folder in [*folders, os.getcwd(), WRITTEN_IN]]
source = PVDReader(registrationName={name!r}, FileName=next(filter(os.path.exists, paths), paths[-1]))
source.UpdatePipeline()

warped = WarpByVector(registrationName="moved", Input=source)
warped.Vectors = ["POINTS", "displacement"]
warped.ScaleFactor = SCALE

tubes = Tube(registrationName="members", Input=warped)
tubes.Scalars = ["POINTS", "radius"]
tubes.VaryRadius = "By Absolute Scalar"
tubes.NumberofSides = 24

view = GetActiveViewOrCreate("RenderView")
shown = Show(tubes, view)
ColorBy(shown, ("POINTS", COLOUR))
times = list(source.TimestepValues)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
given = sys.argv[1:] if sys.argv[1:] and sys.argv[1].endswith(".png") else []
wanted = float(given[1]) if len(given) > 1 else DEGREES[0]
nearest = min(range(len(times)), key=lambda i: abs(DEGREES[i] - wanted))
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
    """Write the macro of an exported collection as ``NAME.paraview.py`` beside it."""
    path = macro_of(collection)
    free_to_write("export", path, overwrite=overwrite)
    colour = "stress_von_mises" if "stress_von_mises" in fields else fields[0]
    text = _MACRO.format(
        name=collection.stem, colour=colour, collection=collection.name,
        folder=str(collection.parent.resolve()), angle=CAM_ANGLE,
        degrees=[round(one, 6) for one in degrees], units=_UNITS,
    )  # fmt: skip
    with whole(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


def macro_of(collection: Path) -> Path:
    """Return where the macro of a collection goes."""
    return collection.with_name(f"{collection.stem}.paraview.py")
