"""What the built-in sensors of one context share: places seen before, and where all agents are."""

from gamms.sensor.nearby import NearbyAgents
from gamms.sensor.views import Views, ViewsPastObstacles
from gamms.typing import IContext


class Memory:
    """One per context.

    Attributes:
        views, views_past_obstacles: what was seen from where.
        nearby: which agents are near a place.
    """

    def __init__(self, ctx: IContext) -> None:
        self.views = Views(ctx)
        self.views_past_obstacles = ViewsPastObstacles(ctx)
        self.nearby = NearbyAgents(ctx, self.views)


def memory_of(ctx: IContext) -> Memory:
    """The memory of the context's sensor room; one of its own for a sensor in a room of somebody else's."""
    shared = getattr(ctx.sensor, "memory", None)
    return shared if isinstance(shared, Memory) else Memory(ctx)
