"""Runs of a case and what is asked of them: comparison, error estimate, limits, stability, Campbell, orders.

May import `case` and everything below it. A new analysis is a file here and a command in `cli`.
"""
