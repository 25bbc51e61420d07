"""How long films take, by the clock on the wall, and frames of windows."""

import os
import random
import tempfile
import time
from fractions import Fraction

from worlds import Spent, fill, grid

import gamms


def film():
    """A film of 300 turns of capture the flag in Helsinki, the game included, against encoding its frames alone.

    Five frames per turn, as `gamms render` makes them; more of them would cost less each. The floor takes frames that
    are painted already: it copies each into a frame of PyAV, which is converted and encoded in the same quality.
    By the clock on the wall, for the encoder works beside the painter.
    """
    import av

    from gamms import scenario
    from gamms.demo import FILE
    from gamms.visual.backends import FILMS

    options = {"preset": "veryfast", "crf": "20", "threads": "2"}  # with nothing beside it, two threads are fastest
    size, folder, game = (1280, 720), tempfile.TemporaryDirectory(), scenario.load(FILE)

    def played(ctx):
        with ctx, ctx.visual.film(f"{folder.name}/game.mp4", 30, *size, frames_per_turn=5) as film:
            ctx.game.run(max_turns=300)
        return film.frames

    def ours():
        ctx = game.build(1)  # the map is loaded before: what is measured are turns
        began = time.perf_counter()
        frames = played(ctx)
        return Spent((time.perf_counter() - began) / frames)

    spent = []  # seconds per fifty frames

    class Floor:
        """A film writer that keeps fifty painted frames, and then measures how long it takes to encode them."""

        def __init__(self, part, *_):
            self.kept, self.number = [], 0
            self.file = av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"})
            self.stream = self.file.add_stream("libx264", rate=30, options=options)
            self.stream.width, self.stream.height, self.stream.pix_fmt = *size, "yuv420p"
            self.frame = av.VideoFrame(*size, "bgra")

        def add(self, picture):
            self.kept.append(picture.bgrx().tobytes())
            if len(self.kept) == 50:
                self.finish(is_over=False)

        def finish(self, is_over=True):
            began = time.perf_counter()
            for pixels in self.kept:
                self.frame.planes[0].update(pixels)
                self.frame.pts, self.frame.time_base = self.number, Fraction(1, 30)
                self.file.mux(self.stream.encode(self.frame))
                self.number += 1
            if is_over:
                self.file.mux(self.stream.encode(None))
                self.file.close()
            spent.append(time.perf_counter() - began)
            self.kept.clear()

        discard = finish

    def floor():
        mp4, FILMS._factories[".mp4"] = FILMS._factories[".mp4"], Floor
        spent.clear()
        try:
            frames = played(game.build(1))
            return Spent(sum(spent) / frames)
        finally:
            FILMS._factories[".mp4"] = mp4

    return ours, floor


def quiet_pygame():
    """The library, without a display and without its greeting."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    return pygame


def big_map():
    """Open a window without a display, on 99,224 edges and ten agents."""
    size = {"width": 1280, "height": 720, "simulation_time_constant": 0.5}
    ctx = gamms.create_context(
        graph_engine=gamms.graph.Engine.MEMORY,
        vis_engine=gamms.visual.Engine.PYGAME,
        vis_kwargs=size,
        logger_config={"level": "CRITICAL"},
    )
    fill(ctx.graph.graph, 158)
    ctx.visual.set_graph_visual(width=1980, height=1080)
    rng = random.Random(1)
    for i in range(10):
        ctx.agent.create_agent(f"a{i}", start_node_id=rng.randrange(158 * 158))
        ctx.visual.set_agent_visual(f"a{i}", color=(255, 0, 0), size=5)
    return ctx


def first_frame():
    """The first frame of a window, against drawing each street once."""
    pygame = quiet_pygame()

    def ours():
        ctx = big_map()
        began = time.process_time()
        ctx.visual.update()
        spent = time.process_time() - began
        ctx.terminate()
        return Spent(spent)

    places, streets = [], []
    for _, x, y in grid(158)[0]:
        places.append((x * 0.4 + 300.0, y * 0.4 + 40.0))
    for _, source, target, _ in grid(158)[1][::2]:
        streets.append((places[source], places[target]))

    def floor():
        surface, line = pygame.Surface((1280, 720)), pygame.draw.aaline
        began = time.process_time()
        for begin, end in streets:
            line(surface, (120, 120, 120), begin, end)
        return Spent(time.process_time() - began)

    return ours, floor


def zoom():
    """The 99th percentile of frames while the camera goes in and out, against making one picture larger."""
    pygame = quiet_pygame()
    ctx = big_map()
    ctx.visual.update()
    view = ctx.visual._render_manager
    size, steps = view.camera_size, 200

    def slowest(frame):
        spent = []
        for step in range(steps):
            began = time.process_time()
            frame(step)
            spent.append(time.process_time() - began)
        return Spent(sorted(spent)[int(0.99 * (steps - 1))])

    def zoomed(step):
        view.camera_size = size * (0.25 + 0.75 * abs(step % 100 / 50 - 1))
        ctx.visual.update()

    picture = pygame.Surface((1100, 620), 0, 32)
    return lambda: slowest(zoomed), lambda: slowest(lambda _: pygame.transform.smoothscale(picture, (1280, 720)))
