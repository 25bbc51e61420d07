"""A window without a display, on a small world, and a person who uses it."""

import pytest

import gamms
from gamms.sensor import SensorType
from gamms.visual import Engine

BEND = [(10.0, 0.0), (12.0, 5.0), (10.0, 10.0)]


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture
def open_window():
    """Opens windows with options of `vis_kwargs`, on a street and a bend with an agent on each end."""
    opened = []

    def open_one(is_empty=False, **options):
        options = {"width": 640, "height": 360, "simulation_time_constant": 0.0, "labels": False, **options}
        ctx = gamms.create_context(vis_engine=Engine.PYGAME, vis_kwargs=options, seed=1)
        opened.append(ctx)
        if not is_empty:
            graph = ctx.graph.graph
            for id, (x, y) in enumerate([(0, 0), (10, 0), (10, 10)]):
                graph.add_node({"id": id, "x": x, "y": y})
            graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 10})
            graph.add_edge({"id": 1, "source": 1, "target": 0, "length": 10})
            graph.add_edge({"id": 2, "source": 1, "target": 2, "length": 11, "linestring": BEND})
            ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
            ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["near"])
            ctx.agent.create_agent("blue_0", start_node_id=2, team="blue")
        return ctx

    yield open_one
    for ctx in opened:
        ctx.terminate()


@pytest.fixture
def ctx(open_window):
    """A context with a window."""
    return open_window()


class Person:
    """A person before the window: what is done is seen by the next frame."""

    def __init__(self):
        import pygame

        self.pygame = pygame

    def _do(self, kind, **what):
        self.pygame.event.post(self.pygame.event.Event(getattr(self.pygame, kind), **what))

    def press(self, *names):
        for name in names:
            self._do("KEYDOWN", key=getattr(self.pygame, f"K_{name}"))

    def release(self, name):
        self._do("KEYUP", key=getattr(self.pygame, f"K_{name}"))

    def point(self, x, y):
        self._do("MOUSEMOTION", pos=(round(x), round(y)), rel=(0, 0), buttons=(0, 0, 0))

    def click(self, x, y):
        for kind in ("MOUSEBUTTONDOWN", "MOUSEBUTTONUP"):
            self._do(kind, button=1, pos=(round(x), round(y)))

    def drag(self, begin, end):
        self._do("MOUSEBUTTONDOWN", button=1, pos=begin)
        self._do("MOUSEMOTION", pos=end, rel=(0, 0), buttons=(1, 0, 0))
        self._do("MOUSEBUTTONUP", button=1, pos=end)

    def turn_wheel(self, notches):
        self._do("MOUSEWHEEL", x=0, y=notches)

    def close(self):
        self._do("QUIT")


@pytest.fixture
def person():
    return Person()


@pytest.fixture
def seen():
    """The pixels of a context's window."""

    def pixels(ctx):
        from gamms.visual.backends.pygame_backend import Canvas

        screen = ctx.visual._screen
        return Canvas(*screen.get_size(), screen).pixels()

    return pixels


@pytest.fixture
def said(monkeypatch):
    """Everything that is written in a frame."""
    from gamms.visual.window import overlay

    words = []
    text = overlay.Canvas.draw_text
    monkeypatch.setattr(
        overlay.Canvas,
        "draw_text",
        lambda self, line, *rest, **more: words.append(line) or text(self, line, *rest, **more),
    )
    return words
