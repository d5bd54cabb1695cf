"""Numbers from HDF5 files: arrays that are none are refused, damaged tables of a file, too."""

import h5py
import numpy as np

# what h5py raises on files whose inner tables are damaged or hold other things than are wanted
DAMAGE = (OSError, KeyError, RuntimeError, TypeError, ValueError, AttributeError)


def numbers(item: object) -> np.ndarray:
    """Return the values of a dataset of numbers; anything else is a KeyError."""
    if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "iuf" or item.shape is None:
        raise KeyError(f"{getattr(item, 'name', 'an object')} holds no array of numbers")
    return item[...]


def all_numbers(group: h5py.Group | dict) -> dict[str, np.ndarray]:
    """Return the values of all datasets of a group by name."""
    return {name: numbers(group[name]) for name in group}


def word(value: object) -> str:
    """Return an attribute that should be one text; another value as it prints."""
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
