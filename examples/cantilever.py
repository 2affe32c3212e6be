"""
A cantilever against theory
===========================

Mesh, matrices, static deflection and modes from the basic functions. Two-node beams are exact in statics at their
nodes; frequencies converge with the fourth power of the element length.
"""

import numpy as np
from matplotlib.figure import Figure

from flexcam import Material, Member, Mesh, Section
from flexcam.dynamics import modes, static_displacement
from flexcam.fem.assembly import build_beams
from flexcam.fem.assembly import mass as fem_mass
from flexcam.fem.assembly import stiffness as fem_stiffness
from flexcam.fem.dofs import COMPONENTS, DofMap, direction, dof_map
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import refine

steel = Material(E=207e9, nu=0.29, density=7800.0)
bar, length = Section.circle(0.020), 0.5


def cantilever(elements: int) -> tuple[Beams, DofMap]:
    """Return the elements of a bar with a clamped root, and their degrees of freedom."""
    line = Mesh([[0, 0, 0], [length, 0, 0]], {"bar": [0, 1]}, {"root": [0], "tip": [1]})
    mesh = refine(line, {"bar": elements})
    beams = build_beams(mesh, {"bar": Member(steel, bar, rotary_inertia=False)})
    return beams, dof_map(mesh, [("root", COMPONENTS)])


# %%
# Static deflection under 100 N at the tip: :math:`F L^3/(3 E I)`.
beams, dofs = cantilever(10)
mass, stiffness = fem_mass(beams, dofs), fem_stiffness(beams, dofs)
load = 100.0 * dofs.vector(1, direction("uy"))  # node 1 of the line is the tip
displacement = static_displacement(stiffness, load, dofs.names)
deflection = displacement[dofs.names.index("tip.uy")]
np.testing.assert_allclose(deflection, 100.0 * length**3 / (3.0 * steel.E * bar.Iz), rtol=1e-9)

# %%
# Bending frequencies: :math:`\omega = b^2 \sqrt{E I/(\rho A L^4)}` with the roots of :math:`\cos b \cosh b = -1`.
# Every frequency of a round bar occurs twice, once in each plane.
roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
theory = roots**2 * np.sqrt(steel.E * bar.Iz / (steel.density * bar.A * length**4))
np.testing.assert_allclose(modes(mass, stiffness, 2).omegas, theory[0], rtol=1e-5)

counts = np.array([2, 4, 8, 16])
errors = np.empty((len(counts), len(roots)))
for row, count in zip(errors, counts, strict=True):
    beams, dofs = cantilever(int(count))
    bending = modes(fem_mass(beams, dofs), fem_stiffness(beams, dofs), 6).omegas[:6:2]
    row[:] = bending / theory - 1.0

# %%
# Half the element length divides the error by sixteen.
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.add_subplot()
for number, column in enumerate(errors.T, 1):
    axes.loglog(counts, column, marker="o", label=f"mode {number}")
axes.loglog(counts, 3e-2 * (counts / 2.0) ** -4, color="0.6", linestyle="--", label="fourth order")
axes.set(xlabel="elements", ylabel="relative error of the frequency", xticks=counts, xticklabels=counts)
axes.minorticks_off()
axes.legend()

orders = np.log2(errors[2] / errors[3])  # from 8 to 16 elements
np.testing.assert_allclose(orders, 4.0, atol=0.1)
