"""Solid geometry of the mechanism at an instant: points and triangles, without a renderer."""
