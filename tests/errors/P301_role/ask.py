"""Ask talus-fem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="surface", id=[1], fields="u")
solver.ask("SET", what="weather")
solver.ask("ABORT")
