"""Who plays: one seat for each living agent, in the order of the names."""

from operator import add, ne
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_range
from gamms.errors import GammsError
from gamms.game.streams import Draws, TurnGenerator
from gamms.ir.agents import Selection
from gamms.typing import AgentType

if TYPE_CHECKING:
    from gamms.game.game import Game

COUNTED = ("moves", "blocked", "illegal", "errors", "overruns")


class Seat:
    """What the engine keeps of one agent.

    Attributes:
        agent: the agent; Any: the agent room's own class.
        name, team, row: its own.
        flies: whether it is in the air.
        speed: how far it may go in a turn, in the unit of the game; None for one edge.
        is_plain: whether it moves along one edge, on the ground.
        template: its state, but for what changes from turn to turn.
        sees_world_only: whether all its sensors are built-in ones, which look at nothing but the graph and the agents.
        foreign: the names of its sensors that are not of GAMMS.
        counts: how often what happened to it; see `COUNTED`.
    """

    __slots__ = (
        "agent",
        "counts",
        "flies",
        "foreign",
        "is_plain",
        "name",
        "row",
        "sees_world_only",
        "speed",
        "team",
        "template",
    )

    def __init__(self, game: "Game", agent: Any) -> None:
        self.agent = agent
        self.name, self.team, self.row = agent.name, agent.team, agent._row
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _speed(agent)
        self.is_plain = not self.flies and self.speed is None and game.legal == "edges"
        self.template: dict[str, Any] = _with_shared_keys(
            {
                "curr_pos": None,
                **({"quat": None} if self.flies else {}),
                "sensor": None,
                "name": self.name,
                "team": self.team,
                "turn": 0,
                "legal": (),
                "draw": Draws(game.ctx.seed, game, self.name),
                "rng": TurnGenerator(game, self.name),
                "memory": game.memory_of(self.name),
                "team_memory": None,
                "facts": game.facts,
            }
        )
        sensors = agent._sensor_list.items()
        self.foreign = [name for name, sensor in sensors if not type(sensor).__module__.startswith("gamms.sensor.")]
        self.sees_world_only = all(_sees_world_only(type(sensor)) for _, sensor in sensors)
        self.counts = game.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))


class _Layout:
    """Lends states the keys that they share."""


def _with_shared_keys(template: dict[str, Any]) -> dict[str, Any]:
    """The same as a dict whose copies share one table of keys, which has room for the action.

    Python has such dicts for the attributes of instances (PEP 412); without them states would be twice as large, and
    those of 1,000 agents would not stay in the cache (benchmarks/README.md, turns).
    """
    instance = _Layout()
    for key in (*template, "action"):
        setattr(instance, key, template.get(key))
    del instance.action  # type: ignore[attr-defined]
    return instance.__dict__


def _sees_world_only(kind: type) -> bool:
    return kind.__module__.startswith("gamms.sensor.") and kind.__module__ != "gamms.sensor.function"


class Seating:
    """A seat for everybody who is alive, in the order of the names, and what of it is asked for in every turn.

    Attributes:
        seats: the seats.
        usual: of each seat, what a usual turn needs, in the form that is read fastest: the agent, and its template if
            it is plain.
        who: the rows of all.
        see_world_only: whether nobody has a sensor that may look at more than the graph and the agents.
        on_ground: which seats are those of agents on the ground; None: all.
        ground: the rows of these.
        place_of: name -> which seat.
        paced: which seats are those of agents on the ground that may cover part of an edge.
    """

    def __init__(self, game: "Game") -> None:
        living = [agent for agent in game.ctx.agent.agents.values() if agent.alive]
        self.seats = [Seat(game, agent) for agent in sorted(living, key=lambda agent: agent.name)]
        self.usual = [(seat.agent, seat.template if seat.is_plain else None) for seat in self.seats]
        self.see_world_only = all(seat.sees_world_only for seat in self.seats)
        ground = [i for i, seat in enumerate(self.seats) if not seat.flies]
        self.on_ground = None if len(ground) == len(self.seats) else ground
        self.who = Selection([seat.row for seat in self.seats])
        self.ground = self.who if self.on_ground is None else Selection([self.seats[i].row for i in ground])
        self.place_of = {seat.name: i for i, seat in enumerate(self.seats)}
        progress = game.columns.progress
        self.paced = [i for i, seat in enumerate(self.seats) if seat.speed is not None or progress[seat.row]]
        self._moved = [0] * len(self.seats)

    def of_ground(self, values: list[Any]) -> list[Any]:
        """Those values, one per seat, that are of agents on the ground."""
        return values if self.on_ground is None else [values[i] for i in self.on_ground]

    def count_moves(self, starts: list[int], ends: list[int]) -> None:
        """Count who went on."""
        # NOTE: in C, because everybody is counted in every turn (benchmarks/README.md, turns).
        self._moved = list(map(add, self._moved, map(ne, starts, ends)))

    def tell(self) -> None:
        """Hand the counted moves on to the seats."""
        for seat, moved in zip(self.seats, self._moved, strict=True):
            seat.counts["moves"] += moved
        self._moved = [0] * len(self.seats)


def _speed(agent: Any) -> float | None:
    if agent.speed is None:
        return None
    try:
        return as_range(agent.speed, f"speed of agent {agent.name!r}")
    except GammsError as error:
        error.add_note("On the ground it is what ctx.game lets the agent move in a turn; None for one edge.")
        raise
