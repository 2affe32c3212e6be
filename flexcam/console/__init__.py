"""Tables and words of every command; `commands` prints what these functions return.

May import `terminal`, `study` and everything below them. A new table is a function in the file of its kind. A command
loads the files of its own tables only.
"""
