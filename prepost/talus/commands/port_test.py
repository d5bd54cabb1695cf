"""`talus port-test`: ask a solver at the exchange port every verb, print what it does wrong."""

import argparse

from talus.faults import FaultError
from talus.port_test import Options, test_solver


def register(commands: argparse._SubParsersAction) -> None:
    """Add `port-test`."""
    new = commands.add_parser(
        "port-test", help="test a solver at the exchange port: talus port-test -- COMMAND"
    )
    new.add_argument("--transport", choices=("shared_memory", "hdf5"), default="shared_memory")
    new.add_argument("--time-limit", type=float, default=10.0, metavar="S",
                     help="silence that counts as a hang [s]; 10")  # fmt: skip
    new.add_argument("--facets", default="", help="group of facets that DESCRIBE shall know")
    new.add_argument("--group", default="", help="group of entities that DESCRIBE shall know")
    new.add_argument("--material", default="", help="of a surface, for grains")
    new.add_argument("--dt", type=float, default=0.0, help="interval of the steps [s]")
    new.add_argument("solver", nargs="+", metavar="COMMAND",
                     help="the solver and its arguments; --port=SPEC is put behind")  # fmt: skip
    new.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Test a solver; E574 (exit code 1) when something was found."""
    chosen = Options(options.transport, options.time_limit, options.facets, options.group,
                     options.material, options.dt)  # fmt: skip
    found, asked, side = test_solver(options.solver, chosen)
    for section, text in found:
        print(f"port.md, {section}: {text}")
    if found:
        raise FaultError("E574", f"{len(found)} faults of the {side} in {asked} requests",
                         "each is printed above with the section of manual/port.md",
                         " ".join(options.solver))  # fmt: skip
    print(f"{asked} requests of the {side} over {options.transport}: no fault")
    return 0
