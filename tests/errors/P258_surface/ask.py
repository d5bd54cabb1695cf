"""Ask talus-dem for a surface of a material that its deck has not."""

from port import Asker

solver = Asker("meeting/side")
solver.hello()
x = [[0.0, 0.0, -0.01], [0.01, 0.0, -0.01], [0.0, 0.01, -0.01]]
surface = {"set": "a", "role": "surface", "id": [1, 2, 3], "x": x, "triangle": [[1, 2, 3]]}
solver.ask("SELECT", material="rubber", **surface)
solver.ask("ABORT")
