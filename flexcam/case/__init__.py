"""Case files: read TOML text, check it into records in SI units with one report of all errors, and build the model.

May import `valvetrain`, `io`, `dynamics`, `fem`, `cams` and `core`. Add a new key as a field of a record in `schema`.
"""
