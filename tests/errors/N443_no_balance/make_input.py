"""One free grain: nothing but the element's single point can balance its contact."""

import numpy as np
from overlap_input import write

write("fit", grains__kind=np.array([1, 2]), grains__cell=np.array([0, 1]))
