"""The case file: TOML text to checked records in SI units, all errors in one report, and records to model and problem.

May import `valvetrain`, `io`, `dynamics`, `fem`, `cams` and `core`. A new key is a field of a record in `schema`, and
`builder` passes it to the model.
"""
