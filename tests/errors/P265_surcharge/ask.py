"""Ask talus-dem to let a grain under a surcharge sleep."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("SLEEP", id=[1])
solver.ask("ABORT")
