"""Write the input."""

from overlap_input import write

write("ramp", depth=0.25)
