"""Ask talus-fem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="report", id=[777], fields="u")
solver.ask("ABORT")
