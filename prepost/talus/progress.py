"""Progress of long work: a bar on a terminal, nothing in a file or a pipe."""

import sys
from collections.abc import Iterable


def watch(items: Iterable) -> Iterable:
    """Pass items on; on a terminal a bar counts them."""
    if not sys.stderr.isatty():
        return items
    from tqdm import tqdm

    return tqdm(items, leave=False)
