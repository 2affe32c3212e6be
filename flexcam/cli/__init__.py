"""Commands: each reads its input, calls the library and prints; it returns the status of its run, or None.

May import everything below it. Add a new command as a function in the file of its kind and a name in `FILES`.
"""
