"""
Modes of a camshaft
===================

The camshaft of a four-cylinder engine, driven at its front end, on five elastic bearings, with eight followers on
their springs. The lowest modes are the followers on their springs; behind them come those of the shaft, drawn here
along it.
"""

import numpy as np
from matplotlib.figure import Figure

import flexcam
from flexcam.plotting.spectra import draw_mode
from flexcam.valvetrain import build_structure

FOLLOWERS, DRAWN = 8, (8, 9, 10, 12)

case = flexcam.read_case("../cases/camshaft-4cyl/camshaft.toml")
structure, found = build_structure(flexcam.build_model(case)), flexcam.modes(case, 16)

# %%
# Eight followers of 0.12 kg and a bucket of some grams, each on 38 kN/m.
followers = found.modes.frequencies[:FOLLOWERS]
np.testing.assert_allclose(
    followers, np.sqrt(38e3 / (0.12 + 7800.0 * 0.25e-4 * np.pi * 3e-3)) / (2.0 * np.pi), rtol=1e-4
)

figure = Figure(figsize=(8.0, 7.0), layout="constrained")
radius = structure.model.members["camshaft"].section.radius
shapes = structure.dofs.nodal(found.modes.shapes.T)
for axes, mode in zip(figure.subplots(len(DRAWN), sharex=True), DRAWN, strict=True):
    shape = shapes[mode]
    largest = float(np.abs(shape[:, :4] * (1.0, 1.0, 1.0, radius)).max())  # its twist, as a motion of the surface
    draw_mode(axes, structure, "camshaft", shape, largest)
    axes.set_title(
        f"{found.modes.frequencies[mode]:.0f} Hz: {found.words(mode).split(', ')[0]}", fontsize="small", loc="left"
    )
axes.set_xlabel("along the shaft, mm")

# %%
# The first mode of the shaft itself is its torsion behind the drive, which the flanks of the cams ring.
assert "torsion" in found.words(DRAWN[0])
assert 1200.0 < found.modes.frequencies[DRAWN[0]] < 1300.0
