"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="report", id=[2], fields="x")
solver.ask("SET", what="mass_factor", set="b", value=[2.0])
solver.ask("ABORT")
