"""Progress of long work: a bar with the time left on a terminal, nothing in a file or a pipe."""

import sys
from collections.abc import Iterable


def watch(items: Iterable, what: str = "", total: int | None = None) -> Iterable:
    """Pass items on; on a terminal a bar counts them and tells the time left.

    `what` stands before the bar; `total` is the number of items where they do not know it.
    """
    if not sys.stderr.isatty():
        return items
    from tqdm import tqdm

    return tqdm(items, desc=what or None, total=total, leave=False)
