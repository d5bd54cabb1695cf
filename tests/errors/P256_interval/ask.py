"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="prescribe", id=[1], fields="x,quat")
solver.ask("READY")
solver.ask("ADVANCE", 5.0e-4, 6.0e-4, a__x=[[0.0, 0.0, 0.0]], a__quat=[[1.0, 0.0, 0.0, 0.0]])
solver.ask("ABORT")
