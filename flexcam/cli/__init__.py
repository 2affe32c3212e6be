"""The commands: each reads its arguments, calls the packages below and returns its output, which is then written.

May import `report` and everything below it. A new command is a function in a file of its name, and a row in
`COMMANDS` of `app`.
"""
