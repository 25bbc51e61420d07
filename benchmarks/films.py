"""How long films take, by the clock on the wall."""

import tempfile
import time
from fractions import Fraction


class Spent(float):
    """Seconds per operation that a case has measured itself; the harness takes them instead of its own clock."""


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
            self.kept.append(bytearray(4 * size[0] * size[1]))
            picture.copy_bgrx(self.kept[-1])
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
