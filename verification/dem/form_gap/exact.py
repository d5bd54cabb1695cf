"""Overlaps of 20 000 random pairs of forms."""

import form_pairs

from talus.verification import Case


def run(case: Case) -> None:
    """Judge one batch."""
    form_pairs.judge(case, 1, 20000, 11)
