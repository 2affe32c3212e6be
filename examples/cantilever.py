"""A cantilever against beam theory: mesh, matrices, statics and modes by hand, then checked.

Run it with ``python examples/cantilever.py``; it says nothing if theory and elements agree.
"""

import numpy as np

from flexcam import Material, Member, Mesh, Section, fem
from flexcam.integrate import static_displacement
from flexcam.modal import modes

steel = Material(E=207e9, nu=0.29, density=7800.0)
bar = Section.circle(0.020)
mesh = fem.refined(Mesh([[0, 0, 0], [0.5, 0, 0]], {"bar": [0, 1]}, {"root": [0], "tip": [1]}), {"bar": 10})
beams = fem.beams(mesh, {"bar": Member(steel, bar, rotary_inertia=False)})
dofs = fem.dof_map(mesh, [("root", fem.COMPONENTS)])
mass, stiffness = fem.mass(beams, dofs), fem.stiffness(beams, dofs)

# Static deflection under 100 N at the tip: F L^3/(3 E I), exact at the nodes.
load = 100.0 * dofs.vector(mesh.node("tip"), fem.direction("uy"))
deflection = static_displacement(stiffness, load, dofs.names)[dofs.names.index("tip.uy")]
np.testing.assert_allclose(deflection, 100.0 * 0.5**3 / (3.0 * steel.E * bar.Iz), rtol=1e-9)

# First bending frequency: 1.8751^2 sqrt(EI/(rho A L^4)), the root of cos(b) cosh(b) = -1.
omega = 1.875104068711961**2 * np.sqrt(steel.E * bar.Iz / (steel.density * bar.A * 0.5**4))
np.testing.assert_allclose(modes(mass, stiffness, 2).omegas, omega, rtol=1e-5)
