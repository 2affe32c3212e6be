"""The commands: each reads its arguments, calls the packages below, prints, and returns the status of its run.

May import `report` and everything below it. A new command is a function in the file of its kind and a name in
`COMMAND_FILES` of `registry`.
"""
