"""Write the input."""

import numpy as np
from overlap_input import write

write(
    "ramp",
    contacts__force=np.array([[0.0, 0.0, 1.0]]),
    points__stress=np.zeros((1, 9)),
    points__couple=np.zeros((1, 9)),
    blocks__load=np.eye(8, 3),
    blocks__free=np.ones((8, 3), int),
    elements__chosen=np.ones(1, int),
)
