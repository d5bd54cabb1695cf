"""Preparation and evaluation of Talus runs."""

from pathlib import Path


def version() -> str:
    """Return the version of the suite."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "VERSION").exists():
            return (folder / "VERSION").read_text().strip()
    return "unknown"
