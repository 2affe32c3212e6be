"""The tables of a case file as checked records in SI, a file per kind."""
