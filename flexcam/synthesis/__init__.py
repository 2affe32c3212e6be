"""Synthesis: better laws and lifts, each with how far it is from the best there can be.

May import `motion`, `linalg`, `units` and `checks`; knows no beam. scipy's optimizers are loaded when they are used.
A new family of laws is a dataclass in `family`; minimax and the Pareto front then work with it.
"""

from flexcam.synthesis.family import Family, HarmonicFamily, SplineFamily
from flexcam.synthesis.harmonic_fit import HarmonicFit, harmonic_fit, harmonics_below
from flexcam.synthesis.minimax import Synthesized, minimax, pareto
from flexcam.synthesis.polydyne import Polydyne, SingleMass, Transfer, motion_at, off_design, polydyne

__all__ = [
    "Family",
    "HarmonicFamily",
    "HarmonicFit",
    "Polydyne",
    "SingleMass",
    "SplineFamily",
    "Synthesized",
    "Transfer",
    "harmonic_fit",
    "harmonics_below",
    "minimax",
    "motion_at",
    "off_design",
    "pareto",
    "polydyne",
]
