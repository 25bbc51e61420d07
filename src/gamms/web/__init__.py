"""Games in the browser: a recording as one HTML file that replays it, offline.

    gamms.recorder.open("game.ggr").save("game.html")

Read `pages.py` first: what such a file holds. The viewer itself is JavaScript, in `viewer/`, where `main.js` is the
first file to read; `scripts/build_viewer.py` makes one page of it, `data/viewer.html`, which ships with GAMMS.

A client: it uses recordings as any program would.
"""

from gamms.web.pages import page, page_of_two
from gamms.web.people import human

__all__ = ["human", "page", "page_of_two"]

FOR_SCENARIOS = {"human": human}
"""What scenario files may name; `strategy: human` is short for it."""
