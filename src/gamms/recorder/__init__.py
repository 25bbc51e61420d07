"""The recorder room: writes what happens in a game, and plays it again.

Read `formats/version2.py` first: the recordings of gamms 1.0.0, one record per event. `components.py` holds the user's
own recorded objects, `struct_types.py` the types of their fields. Nothing in a file is ever evaluated or imported.
May import: typing, kernels, ir and below, never another room. To add a format, add a file to `formats/`.
"""
