"""Write the input."""

from overlap_input import write

write("rampe")
