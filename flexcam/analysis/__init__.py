"""Runs of a case and their analysis: comparison, error estimate, limits, stability, Campbell diagram, orders.

May import `case` and everything below it. Add a new analysis as a file here and a command in `cli`.
"""
