"""Write the input."""

import numpy as np
from overlap_input import write

write("ramp", points__volume=np.ones(3))
