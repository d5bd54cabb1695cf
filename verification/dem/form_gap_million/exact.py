"""Overlaps of a million random pairs of forms."""

import form_pairs

from talus.verification import Case


def run(case: Case) -> None:
    """Judge eleven batches, of which a twelfth at most is left out."""
    form_pairs.judge(case, 11, 100000, 12)
