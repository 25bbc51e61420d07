"""Games in the browser: a recording as one HTML file that replays it, offline.

    gamms.recorder.open("game.ggr").save("game.html")

Read `pages.py` first: what such a file holds; `places.py` makes the page on which places of a map are chosen. The
viewer itself is JavaScript, in `viewer/`, where `main.js` is the first file to read; `scripts/build_viewer.py` makes
one page of it, `data/viewer.html`, which ships with GAMMS, and `data/places.html`.

A client: it uses recordings as any program would.
"""

from gamms.web.pages import page, page_of_two
from gamms.web.people import human
from gamms.web.places import map_page

__all__ = ["human", "map_page", "page", "page_of_two"]

FOR_SCENARIOS = {"human": human}
"""What scenario files may name; `strategy: human` is short for it."""
