"""Materials, sections, meshes, beam elements, assembly and section forces.

May import `core`. A new element is a file in `elements`, a new section shape a constructor in `sections`.
"""
