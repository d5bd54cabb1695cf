"""A sphere far above a sheet."""

import sheet

sheet.write(4, 0.01, 0.0, 0.05)
