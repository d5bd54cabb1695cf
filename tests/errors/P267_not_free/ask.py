"""Ask talus-dem to bring grains to rest that it may not move."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("RELAX", id=[1], steps=[10], tolerance=[1.0e-3])
solver.ask("ABORT")
