"""Reports: what results say, in words, tables, curves and shapes, and as a page for any browser.

May import `console`, `view` and everything below them; owns jinja2 and plotly.js. `content` holds what a report is, as
values; `html` renders it. Another form of a report is a file beside `html`.
"""

from flexcam.report.extras import Asked
from flexcam.report.html import page
from flexcam.report.subject import Subject, subject
from flexcam.report.write import report_of

__all__ = ["Asked", "Subject", "page", "report_of", "subject"]
