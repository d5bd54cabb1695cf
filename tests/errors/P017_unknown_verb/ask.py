"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.forge(99)
solver.ask("ABORT")
