"""Beam elements: axial, torsion and bending in two planes, combined in `beam`.

The modules import numpy only and work on arrays of elements. A new element is a module with its stiffness and mass.
"""
