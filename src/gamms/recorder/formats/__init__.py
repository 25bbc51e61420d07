"""Version 3 of the container of recordings; docs/recording-format.md describes it byte by byte.

A recording is a header, then blocks: keyframes and chunks of turns, then an index and a footer. From the ground up:
`values` (plain values as CBOR), `columns` (integers as packed bytes), `chunks` (the turns of a block), `blocks` (heads,
checksums and limits), `writer` and `reader`.

The log of one turn is one flat list: two ints `row, node` for a move, a tuple `(kind, data)` for any other event.
"""
