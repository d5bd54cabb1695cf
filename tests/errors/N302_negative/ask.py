"""Give talus-fem negative weights at all points."""

import numpy as np
from port import Asker

solver = Asker("meeting/side")
solver.hello()
solver.ask("SET", what="quad_weight", value=np.full(64, -1.0))
solver.ask("READY")
solver.ask("ABORT")
