"""A sphere deep in a sheet of very small triangles that go up and down."""

import sheet

sheet.write(60, 1.5e-3, 2.0e-5, 0.9e-3)
