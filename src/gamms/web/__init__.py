"""Games in the browser: recordings as self-contained HTML pages, live games, people as players, and studies.

    gamms.recorder.open("game.ggr").save("game.html")

    with gamms.web.serve(gamms.scenario.load("hunt.yaml")) as live:
        print(live.url)
        live.wait()

Read `pages.py` first, which makes the page of a recording. `live.py` serves a game while it is played: `streams.py`
writes the data for spectators, `links.py` holds tokens and permissions, and `server.py` handles HTTP and WebSocket.
`people.py` lets people play; `choices.py` checks their answers. `study.py` runs studies, with `participants.py` for
their participants. `places.py` makes a page of a map on which people choose places. The viewer is JavaScript, in
`viewer/` (read `main.js` first); `bundle.py` makes a single page of it.

May import: all layers below the clients. It uses only public methods of recordings and contexts.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.web.live import Live, ServeOptions, serve
from gamms.web.pages import page, page_of_two
from gamms.web.people import human
from gamms.web.places import map_page
from gamms.web.study import Study, StudyOptions, study

__all__ = [
    "Live",
    "ServeOptions",
    "Study",
    "StudyOptions",
    "human",
    "map_page",
    "page",
    "page_of_two",
    "serve",
    "study",
]

_suggest_names(__name__, __all__)

FOR_SCENARIOS = {"human": human}
"""Names that scenario files may use without a package: `strategy: human`."""
