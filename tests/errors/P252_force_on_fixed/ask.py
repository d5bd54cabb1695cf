"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="load", id=[1], fields="x")
solver.ask("ABORT")
