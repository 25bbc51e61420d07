"""Games in the browser: a recording as one HTML file that replays it, offline; and games that are served live.

    gamms.recorder.open("game.ggr").save("game.html")

    with gamms.web.serve(gamms.scenario.load("hunt.yaml")) as live:
        print(live.url)
        live.wait()

Read `pages.py` first: what such a file holds; then `live.py`: a game that is served while it is played, with
`streams.py`, what its spectators are sent, `links.py`, what they may, and `server.py`, HTTP and WebSocket. People who
play: `people.py`, then `choices.py`, what they are asked, `playing.py`, how that travels, and `study.py`, with
`participants.py`, who takes part. `places.py` makes the page of a map, on which people choose
places. The viewer itself is JavaScript, in `viewer/`, where `main.js` is the first file to read;
`bundle.py` makes one page of it.

A client: it uses recordings and contexts as any program would.
"""

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

FOR_SCENARIOS = {"human": human}
"""What scenario files may name; `strategy: human` is short for it."""
