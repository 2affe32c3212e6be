"""The beam element: axial, torsion and two bending planes, each a file, put together in `beam`.

Imports numpy only; works on arrays of elements at once. A new element is a file here with its stiffness and mass.
"""
