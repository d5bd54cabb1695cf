"""Ask talus-fem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.ask("HELLO", run_id="test", restart="", protocol=3)
solver.ask("ABORT")
