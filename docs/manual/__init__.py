"""Verification manual: rows that the tests record, pages generated from them, and figures.

`rows` keeps and checks the rows, `tables` writes them, `figures` draws, `pages` puts a page together from its template
(`*.md.j2`). Another published system is a template here, a line in ``pages.SYSTEMS`` and a function in ``figures``.
"""
