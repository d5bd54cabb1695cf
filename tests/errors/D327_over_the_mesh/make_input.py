"""Make a good mesh with the name of the deck."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

meshes.write_mesh(Path("deck.h5"), meshes.box(np.zeros(3), np.ones(3), (1, 1, 1)))
