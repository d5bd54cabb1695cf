"""Ask talus-dem for what it does not have."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SELECT", set="a", role="prescribe", id=[1], fields="x,quat")
solver.ask("READY")
solver.ask("ADVANCE", 0.0, 5.0e-5, a__x=[[float("nan"), 0.0, 0.0]], a__quat=[[1.0, 0.0, 0.0, 0.0]])
solver.ask("ABORT")
