"""Version 3 of the container of recordings; docs/recording-format.md describes it byte by byte.

A recording is a header, then blocks: keyframes and chunks of turns, then an end. The modules from bottom to top:
`ir/packing.py` (columns and plain values as bytes), `blocks` (heads, checksums and limits, and the list of blocks of a
file), `chunks` (the turns of a block; moves and flights by agent), `writer` and `reader`. `version2` reads and writes
the recordings of gamms 1.0.0.

The log of one turn is a flat list: two ints `row, node` for a move, a tuple `(kind, data)` for any other event.
"""
