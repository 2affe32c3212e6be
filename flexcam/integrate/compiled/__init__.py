"""The compiled way through time: an uncoupled system with local forces, many steps per call.

Imports `integrate` and below; numba only when machine code is fetched (`machine`). A new law is a `Kind` in
`flexcam.system.formula` and a branch of `kernel.respond`.
"""
