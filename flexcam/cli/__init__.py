"""The commands: each reads its arguments, calls the packages below, prints, and returns the status of its run.

May import `report` and everything below it. A new command is a function in a file of its name, and a row in
`COMMANDS` of `app`.
"""
