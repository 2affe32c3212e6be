"""Words beside drawn mechanisms."""

from __future__ import annotations

from collections.abc import Sequence


def drawing_words(notes: Sequence[str]) -> list[str]:
    """Return what is said of the sizes that a picture has and its case does not give."""
    return ["Drawn with sizes that the case does not give:", *(f"  {note}" for note in notes)] if notes else []
