"""Set a stress that the law takes and look at what holds it, then one outside the yield surface."""

import sys

import numpy as np
from port import Asker

solver = Asker("meeting/side")
solver.hello()
top = np.arange(19, 28)
solver.ask("SELECT", set="top", role="prescribe", id=top, fields="u")
solver.ask("READY")
stress = np.tile([-1.0e5, -1.0e5, -1.0e5, 0.0, 0.0, 0.0], (64, 1))
solver.ask("SET", what="initial_stress", value=stress)
reply = solver.ask("SOLVE", 0.0, 1.0, top__u=np.zeros((9, 3)))
force = float(np.asarray(reply.fields["top.reaction"])[:, 2].sum())
if abs(force + 10.0) > 1e-9:  # 100 kPa on 1 cm2
    sys.exit(f"the top carries {force} N, not -10 N")
solver.ask("REJECT")
stress[:, 2] = -1.0e7
solver.ask("SET", what="initial_stress", value=stress)
solver.ask("ABORT")
