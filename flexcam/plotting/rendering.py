"""Check of the renderer, and output files of views.

This module imports no renderer: VTK aborts its process if a library is missing.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingImports=false
# pyvista and imageio do not type most of their interface.

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from flexcam.core.errors import refuse, require_packages, system_message
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.io import atomic_write_path, check_writable

if TYPE_CHECKING:
    from flexcam.plotting.solid_view import MechanismView

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"  # environment variable of VTK with the class of its window
_PROBE = """
import sys, pyvista
plotter = pyvista.Plotter(off_screen=sys.argv[1] == "off", window_size=(32, 32))
plotter.set_background("white")
plotter.add_mesh(pyvista.Sphere(), color="black", lighting=False)
if sys.argv[1] == "off":
    image = plotter.screenshot(return_img=True)
else:
    plotter.show(interactive=False, auto_close=False)
    if "EGL" in plotter.render_window.GetClassName() or "OSOpenGL" in plotter.render_window.GetClassName():
        sys.exit("no display answers")
    image = plotter.screenshot(return_img=True)
sys.exit(0 if image.min() < 100 < image.max() else "the picture is empty")
"""

_TIMEOUT = 60.0  # of a rendering test, s
_COLOUR, _HEAD = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"^.*\b(?:WARN|ERR)\| ")  # in lines of VTK's log
# Classes of VTK windows that need no display; the first is tried before the default class, the other after it
_OFF_SCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
_REMEDY = (
    "install a renderer: on Debian and Ubuntu `apt-get install libgl1 libegl1 libegl-mesa0 libx11-6`, and for a window "
    "without a screen `xvfb`, then `xvfb-run flexcam view ...`; curves (flexcam plot) need none of it"
)


def select_renderer(*, off_screen: bool) -> None:
    """Select a class of window that works, by rendering a sphere in a separate process."""
    display = sys.platform != "linux" or bool(os.environ.get("DISPLAY"))
    if not display and not off_screen:
        why, remedy = "there is no display for a window", "add --save picture.png (or .gif, .mp4, .html)"
        raise refuse("flexcam view", "no DISPLAY", "a display, or --save", why, remedy)
    own = os.environ.get(_WINDOW)
    without = _OFF_SCREEN if off_screen and sys.platform == "linux" else ()
    windows = [own] if own else [*without[:1], *([""] if display else []), *without[1:]]
    why = ""
    for window in windows:
        why = _test_renderer(window, off_screen=off_screen)
        if not why:
            if window:
                os.environ[_WINDOW] = window
            return
    raise RunFailedError(Status(Cause.NO_RENDERING, f"rendering does not work on this system: {why}", _REMEDY))


@cache
def _test_renderer(window: str, *, off_screen: bool) -> str:
    """Return why a class of window cannot render; empty if it can."""
    environment = {**os.environ, **({_WINDOW: window} if window else {})}
    command = [sys.executable, "-c", _PROBE, "off" if off_screen else "on"]
    try:
        done = subprocess.run(  # noqa: S603 - our own words
            command, env=environment, capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"drawing took more than {_TIMEOUT:g} s"
    except OSError as fault:  # no separate interpreter, or it may not be started
        return f"no process can be started: {system_message(fault)}"
    if done.returncode == 0:
        return ""
    lines = [_HEAD.sub("", _COLOUR.sub("", line)).strip() for line in done.stderr.splitlines()]
    return next((line for line in reversed(lines) if line), f"the renderer ended with {done.returncode}")


# Requirements by file type: the extra of flexcam and its modules
REQUIREMENTS = {
    ".png": ("", ()),
    ".gif": ("movie", ("imageio",)),
    ".mp4": ("movie", ("imageio", "imageio_ffmpeg")),
    ".html": ("", ()),
}

FRAMES = 72  # frames per revolution
_PER_SECOND = 24


def check_output_path(path: Path, size: tuple[int, int], *, overwrite: bool = False) -> None:
    """Raise an error if an output file cannot be written, before rendering."""
    if path.suffix not in REQUIREMENTS:
        raise refuse("--save", str(path), f"a name that ends in one of {', '.join(REQUIREMENTS)}")
    extra, modules = REQUIREMENTS[path.suffix]
    require_packages("--save", str(path), extra, *modules)
    if path.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise refuse("--size", f"{size[0]}x{size[1]}", "even numbers", "colours are stored for 2 x 2 pixels")
    check_writable("picture", path, overwrite=overwrite)


def save_view(stage: MechanismView, path: Path, frames: Sequence[int], still: int) -> None:
    """Write an image of one instant, or a movie of several."""
    with atomic_write_path(path) as draft:
        match path.suffix:
            case ".gif":  # in memory: the writer of files would print system errors and continue
                from imageio.v2 import get_writer

                made, duration = io.BytesIO(), 1000.0 / _PER_SECOND  # ms
                stage.plotter.mwriter = get_writer(made, format=".gif", mode="I", duration=duration, loop=0)
                _write_frames(stage, frames)
                stage.plotter.mwriter.close()  # before the plotter, which ignores errors of the writer
                draft.write_bytes(made.getvalue())
            case ".mp4":
                quiet = {"ffmpeg_log_level": "quiet"}  # the error is reported below
                stage.plotter.open_movie(str(draft), framerate=_PER_SECOND, macro_block_size=2, **quiet)
                _write_frames(stage, frames)
                stage.plotter.close()
                if b"moov" not in draft.read_bytes():  # the writer does not report a full disk
                    raise OSError("its end is missing: no space left, perhaps")
            case _:
                stage.show_alone(still)
                stage.plotter.screenshot(draft)
        stage.plotter.close()


def _write_frames(stage: MechanismView, frames: Sequence[int]) -> None:
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()
