"""Tables, sentences and HTML pages of results.

May import `plotting`, `studies` and everything below them. Add a new table as a function in a module named after its
subject.
"""
