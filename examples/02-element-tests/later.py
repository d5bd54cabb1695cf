"""Print a deck with the end of an earlier run added to its times with a plus sign.

Usage: later.py DECK SUMMARY_JSON
"""

import json
import re
import sys
from pathlib import Path


def main() -> int:
    """Print the deck."""
    start = json.loads(Path(sys.argv[2]).read_text())["time_s"]
    text = Path(sys.argv[1]).read_text()
    later = re.sub(r"(?<=[ ])\+([0-9.]+)", lambda found: f"{start + float(found[1]):.12g}", text)
    sys.stdout.write(later)
    return 0


if __name__ == "__main__":
    sys.exit(main())
