"""Make docs/pictures/methods.svg: spectral radius, period error and damping of the integrators."""

from __future__ import annotations

from pathlib import Path

from flexcam.dynamics import bathe, central_difference, generalized_alpha, hht, newmark
from flexcam.plotting.curves import method_figure
from flexcam.plotting.figures import save_figure

METHODS = {
    "average acceleration": newmark(),
    "linear acceleration": newmark(beta=1 / 6),
    "HHT, alpha = -0.1": hht(alpha=-0.1),
    "generalized-alpha, rho = 0.8": generalized_alpha(rho_inf=0.8),
    "Bathe": bathe(),
    "central difference": central_difference(),
}


def main() -> None:
    """Write the picture."""
    save_figure(method_figure(METHODS), Path(__file__).parent / "pictures" / "methods.svg", overwrite=True)


if __name__ == "__main__":
    main()
