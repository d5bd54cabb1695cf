"""Ask talus-dem for an interval of one and a half of its fixed steps."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("ADVANCE", 0.0, 7.5e-6)
solver.ask("ABORT")
