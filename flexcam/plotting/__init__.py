"""Curves with matplotlib and mechanisms in 3D with pyvista.

May import `analysis` and everything below it. A new figure is a function that draws into given axes;
a new solid is a function in `scene.parts`.
"""
