"""Ask talus-dem for a kind of grain that it sets itself."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("READY")
solver.ask("SET", what="kind", id=[1], kind=[1])
solver.ask("ABORT")
