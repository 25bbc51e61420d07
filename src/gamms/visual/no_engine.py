"""The engine without a window: shows nothing, and draws when a picture or a film is asked for."""

from typing import Any

from gamms.typing import IContext
from gamms.visual.engine import PictureEngine


class NoEngine(PictureEngine):
    """Takes every call of a windowed engine, and shows nothing."""

    def __init__(self, ctx: IContext, **kwargs: Any) -> None:
        super().__init__(ctx, simulation_time_constant=kwargs.get("simulation_time_constant", 2.0))

    def get_viewport(self) -> None:
        """None: nothing is shown."""
        return
