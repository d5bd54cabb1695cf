"""Ask grains on two ranks for forces at once."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="prescribe", id=[1], fields="x,quat")
solver.ask("READY")
solver.ask("FORCE", scope="all")
solver.ask("ABORT")
