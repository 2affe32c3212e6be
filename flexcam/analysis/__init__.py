"""Runs of a case and their analysis: comparison, error estimate, limits, stability, Campbell diagram, orders.

May import `case` and everything below it. A new analysis is a file in this package and a command in the package
that holds the command line.
"""
