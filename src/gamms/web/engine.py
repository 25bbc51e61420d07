"""The visual engine that shows a game in browsers; it replaces a window without other changes to the program."""

import sys
from contextlib import suppress
from time import sleep

from gamms.arguments import as_bool, as_range, explain_misspelled
from gamms.context import Context
from gamms.deciding import refuse_while_deciding
from gamms.typing.visualization_engine import live_engines
from gamms.visual import PictureEngine
from gamms.web.live import Live, ServeOptions

_OPTIONS = ("port", "host", "allow_network", "title", "simulation_time_constant", "stay_open")
_LOOK_S = 0.2


@live_engines.register("gamms")
class WebEngine(PictureEngine):
    """Shows the turns of a context in browsers, at the speed of a window.

    Args:
        ctx: the context.
        simulation_time_constant: seconds per turn.
        stay_open: whether a `with` block of the context ends only after all browsers have disconnected, or by Ctrl-C.
        options: `port`, `host`, `allow_network` and `title`, as for `gamms.web.serve`.

    Attributes:
        live: the handle, with the links.

    Raises:
        MissingExtra (ImportError): the extra `web` is not installed.
        NetworkError (ConnectionError): the port is in use.
    """

    def __init__(
        self, ctx: Context, *, simulation_time_constant: float = 2.0, stay_open: bool = True, **options: object
    ) -> None:
        super().__init__(ctx, simulation_time_constant=simulation_time_constant)
        seconds = as_range(simulation_time_constant, "simulation_time_constant")
        self._stays_open = as_bool(stay_open, "stay_open")
        for sentence in explain_misspelled(options, _OPTIONS):
            ctx.logger.warning("vis_kwargs: %s", sentence)
        chosen: ServeOptions = {"speed": 1.0 / seconds if seconds > 0.0 else None}
        for name in ("port", "host", "allow_network", "title"):
            if name in options:
                chosen[name] = options[name]  # type: ignore[typeddict-item] # `Live` checks it
        self.live = Live(ctx, chosen)
        # Not logged, because anyone who has the link can use it.
        sys.stderr.write(f"The game is served: {self.live.links['admin']} (to look on: {self.live.url})\n")

    @refuse_while_deciding
    def simulate(self) -> None:
        """End the turn, show it, and wait until the next turn may begin."""
        super().simulate()
        self.live.follow()

    def stay_open(self) -> None:
        """Keep showing the last turn until Ctrl-C."""
        self.live.stay_open()

    def stay_open_after_game(self) -> None:
        """Keep showing the last turn at the end of a `with` block while a browser is connected."""
        with suppress(KeyboardInterrupt):
            while self._stays_open and self.live.connections:
                sleep(_LOOK_S)

    @refuse_while_deciding
    def terminate(self) -> None:
        """Stop the server, and finish open films."""
        self.live.close()
        super().terminate()
