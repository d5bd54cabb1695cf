"""Decks of three spheres and of a cube, for tests of the port."""

GRAINS = """&run       title = 'Three spheres', gravity = 0.0, 0.0, 0.0 /
&material  id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5 /
&particles file = 'pack.h5', material = 'quartz' /
&dynamics  dt = 1.0e-6 /
"""
SOLID = """&run      title = 'Cube', gravity = 0.0, 0.0, 0.0 /
&mesh     file = 'cube.h5' /
&material id = 'soil', density = 1500.0, young = 1.0e7, poisson = 0.3 /
&section  group = 'all', material = 'soil' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = '{kind}' /
"""
