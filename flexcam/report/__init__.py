"""Tables, sentences and the HTML page that show results.

May import `analysis`, `plotting` and everything below them. A new table is a function in `tables`; a new section of the
page is added in `content`.
"""
