"""Present views of sensors, from where the agents are drawn; looking changes nothing."""

from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

from gamms.errors import BadType, NotOffered
from gamms.ir.sensed import SensorView
from gamms.text import shown
from gamms.typing import IContext, ISensor, SensorType


class Sight(NamedTuple):
    """The view of a sensor for the agent that carries it, or its last view if none does."""

    sensor: ISensor
    carrier: str | None
    view: SensorView | None  # None: it cannot say; drawing it will tell why


class Carriers:
    """The agents that carry each sensor, found again only when agents or what they carry have changed."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._key: Any = None
        self._of: dict[int, list[Any]] = {}

    def of(self, sensor: Any) -> list[Any]:
        """The agents that carry a sensor, dead ones too, in the order of their creation."""
        roster = getattr(getattr(self._ctx.agent, "columns", None), "roster", None)
        if roster is None or roster != self._key:  # an engine of the user's own does not count
            self._key, self._of = roster, {}
            for agent in self._ctx.agent.create_iter():
                for one in getattr(agent, "_sensor_list", {}).values():
                    carriers = self._of.setdefault(id(one), [])
                    carriers += [agent] * (agent not in carriers[-1:])
        return self._of.get(id(sensor), [])

    def is_blind(self, sensor: Any) -> bool:
        """Whether all agents that carry a sensor are out of the game."""
        carriers = self.of(sensor)
        return bool(carriers) and not any(agent.alive for agent in carriers)

    def sights(self, most: int) -> list[Sight]:
        """What the sensors see that have looked; nothing where there are more than so many."""
        found = list(islice(self._looking(), most + 1))
        return [] if len(found) > most else [self.sight(*one) for one in found]

    def _looking(self) -> Iterator[tuple[Any, Any]]:
        """Sensors that have looked, with each living agent that carries them, or None."""
        game = self._ctx.current_game
        is_played = game is not None and game.turn > 0  # here or in a recording: then everybody has looked
        for sensor in self._ctx.sensor.sensors.values():
            carriers = self.of(sensor)
            living = [agent for agent in carriers if agent.alive] if carriers else [None]
            if sensor.type is not SensorType.NEIGHBOR and living and ((is_played and carriers) or _has_looked(sensor)):
                yield from ((sensor, agent) for agent in living)

    @staticmethod
    def sight(sensor: Any, agent: Any) -> Sight:
        """What a sensor sees for an agent; None: what it saw last, or would see from there."""
        look = getattr(sensor, "view_from", None)  # a class that is no child of ISensor has none
        place, name = (None, None) if agent is None else (agent.current_node_id, agent.name)
        try:
            view = view_of(sensor) if look is None else look(place, name)
            return Sight(sensor, name, view if isinstance(view, SensorView) else None)
        except NotOffered:
            return Sight(sensor, name, SensorView())
        except Exception:  # noqa: BLE001 - a sensor is user code; its artist will fail likewise, which is logged
            return Sight(sensor, name, None)


def view_of(sensor: ISensor) -> SensorView:
    """What a sensor saw last.

    Raises:
        NotOffered: it has no `last_view`.
        BadType: its `last_view` returns something else.
    """
    if not hasattr(sensor, "last_view"):  # a class that is no child of ISensor may be a sensor, too
        raise NotOffered(sensor, "last_view, so it cannot be drawn")
    view = sensor.last_view()
    if not isinstance(view, SensorView):
        raise BadType(f"last_view of sensor {sensor.sensor_id!r} must return a SensorView, not {shown(view)}.")
    return view


def _has_looked(sensor: Any) -> bool:
    try:
        return says_something(view_of(sensor))
    except NotOffered:
        return False
    except Exception:  # noqa: BLE001 - see above
        return True


def says_something(view: SensorView) -> bool:
    """Whether there is anything to draw."""
    return any(len(part) for part in (view.nodes, view.lines, view.agents, view.outline))
