"""The mechanism as solids at an instant: points and triangles, no renderer."""
