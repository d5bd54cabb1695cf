"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="prescribe", id=[1], fields="x,quat")
solver.ask("READY")
solver.ask("SOLVE", trial=1)
solver.ask("ABORT")
