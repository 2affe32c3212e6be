"""The records of the case format, a file per group of tables."""
