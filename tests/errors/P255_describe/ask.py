"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("DESCRIBE", what="weather")
solver.ask("SET", what="curl")
solver.ask("ABORT")
