"""Materials, sections, meshes, beam elements, assembly and section forces.

May import `core`. A new element is a file in `elements`; a new section shape is a constructor in `sections`.
This package is independent of dynamics and cams.
"""
