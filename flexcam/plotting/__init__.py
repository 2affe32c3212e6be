"""Curves with matplotlib and 3D views of mechanisms with pyvista.

May import `analysis` and everything below it. Add a new figure as a function that draws into given axes.
"""
