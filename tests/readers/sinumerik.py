"""Reads SINUMERIK motion from standard input; writes the place after each block, one line of X Y Z A B C each."""

import sys

from nc_gcode_interpreter import nc_to_dataframe

frame, _ = nc_to_dataframe(sys.stdin.read(), extra_axes=["A", "B", "C"], iteration_limit=1_000_000)
for row in frame.iter_rows(named=True):
    places = (row.get(axis) for axis in "XYZABC")
    print(" ".join("nan" if place is None else repr(float(place)) for place in places))
