"""What agents and teams know in a turn, by the reports of their sensors and the messages that they have heard.

Recordings, cuts, streams, pages, pictures in fog, private forks and beliefs read it from here; none of them decides
for itself what a team may know.

Read `looks.py` first: the reports of sensors, of a live game and as columns. `fields.py` has the nodes that sensors
cover. `sides.py` computes what the agents of a side see, witness and have heard, which flags they know, and which
columns, fields and events of a recording. To change who may know something, change `sides.py`, or the audience or role
that the column or field declares.
May import: `typing` and below.
"""
