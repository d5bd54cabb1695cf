"""`talus watch`: progress, curves and last frame of a running job in the browser."""

import argparse
from pathlib import Path

from talus import watch
from talus.arguments import natural


def register(commands: argparse._SubParsersAction) -> None:
    """Add `watch`."""
    new = commands.add_parser("watch", help="progress, curves and last frame of a running job")
    new.add_argument("folder", metavar="RUN", type=Path, help="folder in which the programs run")
    new.add_argument("--port", type=natural, default=0, help="on loopback (default: a free one)")
    new.set_defaults(run=work)


def work(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    watch.serve(options.folder, options.port)
    return 0
