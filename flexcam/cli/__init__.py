"""The commands: read, call, print; each returns the status of its run, or None.

May import everything below it. A new command is a function in the file of its kind and a name in `FILES`.
"""
