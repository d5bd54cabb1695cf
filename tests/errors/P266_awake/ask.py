"""Ask talus-dem to wake a grain that is awake."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("WAKE", id=[2], x=[[0.0, 0.0, 0.1]], axes=[[1.0e-3, 1.0e-3, 1.0e-3]])
solver.ask("ABORT")
