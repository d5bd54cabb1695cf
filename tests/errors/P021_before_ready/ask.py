"""Ask talus-fem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SOLVE", trial=1)
solver.ask("ABORT")
