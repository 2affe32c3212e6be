"""How far Newton's iteration on local forces goes: plain numbers, for the steps of every way through time."""

from __future__ import annotations

TOLERANCE = 1e-12
"""Of the force: three digits above rounding, so that Newton's last quadratic step reaches it."""

ROUNDING = 16.0 * 2.220446049250313e-16
"""Of the terms a stiff law multiplies: the sensed scalars themselves carry a few eps."""

MOST_ITERATIONS = 60

WHOLE_STEPS = 8
"""Iterations after which a step of Newton's must lessen what is missing, or is halved: contacts that open and close in
turn would be gone back and forth between for ever."""

LEAST_PART = 1.0 / 64.0
"""Of a step of Newton's, below which it is taken whatever comes of it."""
