"""Hydraulic lash adjusters: a plunger on oil that leaks, with a check valve and a spring.

While the oil column is pressed by e = gamma - z it carries k e and leaks, z' = k e/c. When it would be pulled the check
valve opens: oil flows in, z' = k e/c0 with a c0 much smaller than c, and only the plunger's spring pushes. The internal
state z is the leak-down since installation. At rest the plunger's spring has taken up all
play.
"""

from __future__ import annotations

from flexcam.system import AngleVector, Channel, force_sum, oil_column_law
from flexcam.train.contacts import conservative, play_row
from flexcam.train.coupling import Coupling
from flexcam.train.model import Adjuster
from flexcam.train.structure import Structure


def couple_adjuster(structure: Structure, name: str, part: Adjuster) -> Coupling:
    """Return a hydraulic lash adjuster.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    part
        The adjuster.

    Returns
    -------
    Coupling
        A local force with the channels force and leak-down.
    """
    where = f"contacts.{name}"
    law = oil_column_law(part.stiffness, part.leak, part.refill, part.plunger_force)
    force = conservative(where, AngleVector.constant(play_row(structure, part, where)), law)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.leak_down", "m", lambda seen: seen.states[:, 0]),
    ))  # fmt: skip
