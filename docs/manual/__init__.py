"""The verification manual: rows that the tests record, pages made of them, and figures that flexcam computes.

`rows` keeps and checks the rows, `tables` writes them, `figures` draws, `pages` puts a page together from its template
(`*.md.j2`). Another published system is a template here, a line in ``pages.SYSTEMS`` and a function in ``figures``.
"""
