"""
Modes of a camshaft
===================

The camshaft of a four-cylinder engine has a drive at its front end, five elastic bearings and eight followers with
springs. In the lowest modes the followers oscillate on their springs. The figure shows some modes of the shaft.
"""

import numpy as np
from matplotlib.figure import Figure

import flexcam
from flexcam.plotting.spectra import draw_mode
from flexcam.valvetrain import build_structure

FOLLOWERS, SHAFT_MODES = 8, (8, 9, 10, 12)

case = flexcam.read_case("../cases/camshaft-4cyl/camshaft.toml")
structure, found = build_structure(flexcam.build_model(case)), flexcam.modes(case, 16)

# %%
# Each follower consists of 0.12 kg and a bucket of some grams; the spring has 38 kN/m.
followers = found.modes.frequencies[:FOLLOWERS]
np.testing.assert_allclose(
    followers, np.sqrt(38e3 / (0.12 + 7800.0 * 0.25e-4 * np.pi * 3e-3)) / (2.0 * np.pi), rtol=1e-4
)

figure = Figure(figsize=(8.0, 7.0), layout="constrained")
radius = structure.model.members["camshaft"].section.radius
shapes = structure.dofs.nodal(found.modes.shapes.T)
for axes, mode in zip(figure.subplots(len(SHAFT_MODES), sharex=True), SHAFT_MODES, strict=True):
    shape = shapes[mode]
    amplitude = float(np.abs(shape[:, :4] * (1.0, 1.0, 1.0, radius)).max())  # torsion as motion of the surface
    draw_mode(axes, structure, "camshaft", shape, amplitude)
    axes.set_title(
        f"{found.modes.frequencies[mode]:.0f} Hz: {found.words(mode).split(', ')[0]}", fontsize="small", loc="left"
    )
axes.set_xlabel("along the shaft, mm")

# %%
# The first mode of the shaft is torsion, which the cam flanks excite.
assert "torsion" in found.words(SHAFT_MODES[0])
assert 1200.0 < found.modes.frequencies[SHAFT_MODES[0]] < 1300.0
