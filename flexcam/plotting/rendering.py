"""Check of rendering. This module imports no renderer: if a library is missing, VTK aborts its process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import cache

from flexcam.core.errors import refuse, system_message
from flexcam.dynamics import Cause, RunFailedError, Status

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable of VTK with the class of its window."""

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

_TIMEOUT = 60.0
"""Timeout of a rendering test, s."""

_REMEDY = (
    "install what draws: on Debian and Ubuntu `apt-get install libgl1 libegl1 libegl-mesa0 libx11-6`, and for a window "
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
    told = ""
    for window in windows:
        told = _test_renderer(window, off_screen=off_screen)
        if not told:
            if window:
                os.environ[_WINDOW] = window
            return
    raise RunFailedError(Status(Cause.NO_RENDERING, f"nothing can be drawn here: {told}", _REMEDY))


_OFF_SCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""Classes of VTK windows that need no display; the first is tried before the default class, the other after it."""


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


_COLOUR, _HEAD = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"^.*\b(?:WARN|ERR)\| ")
"""Prefixes and colour codes in lines of VTK's log."""
