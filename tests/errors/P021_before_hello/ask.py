"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.ask("DESCRIBE", what="grains")
solver.ask("ABORT")
