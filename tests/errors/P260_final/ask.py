"""Ask talus-dem to go back behind a step that was said to be final."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("ADVANCE", 0.0, 5.0e-5)
solver.ask("ACCEPT", final=[1])
solver.ask("REJECT")
solver.ask("ABORT")
