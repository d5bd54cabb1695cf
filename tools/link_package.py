"""Make the package `talus` of this checkout and its command known to the running environment.

A path file and a three-line command do what an editable install does, without a build back end
that would have to be fetched.
"""

import stat
import sys
import sysconfig
from pathlib import Path

COMMAND = """#!{python}
import sys
from talus.cli import main
sys.exit(main())
"""


def main() -> int:
    """Write talus.pth and the command `talus`; return 0."""
    package = Path(__file__).resolve().parent.parent / "prepost"
    site = Path(sysconfig.get_paths()["purelib"])
    (site / "talus.pth").write_text(f"{package}\n")
    command = Path(sysconfig.get_paths()["scripts"]) / "talus"
    command.write_text(COMMAND.format(python=sys.executable))
    command.chmod(command.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    return 0


if __name__ == "__main__":
    sys.exit(main())
