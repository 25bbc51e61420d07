"""A context on a road of ten nodes, and moves on it."""

from contextlib import ExitStack

import pytest

import gamms
from gamms.typing.game import Move


def moves_of(*ways, teams=None):
    """Moves by name: "a" goes the first way `(start, end)`, "b" the second, …; `teams` by name."""
    names = [chr(ord("a") + number) for number in range(len(ways))]
    teams = teams or {}
    return {
        name: Move(name, teams.get(name), start, end, (start,) if start == end else (start, end))
        for name, (start, end) in zip(names, ways, strict=True)
    }


@pytest.fixture(scope="module")
def ctx():
    with gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes(range(10), range(10), [0] * 10)
        yield ctx


@pytest.fixture
def stay(ctx):
    """Who has to stay, in one string: `stay(conflicts, (start, end), …)`."""

    def who(conflicts, *ways, teams=None):
        return "".join(sorted(conflicts.resolve(moves_of(*ways, teams=teams), ctx)))

    return who


def walk(*nodes):
    """A strategy: the first node in the first turn, the second in the second, …; then stay."""

    def strategy(state):
        state["action"] = nodes[state["turn"]] if state["turn"] < len(nodes) else state["curr_pos"]

    return strategy


@pytest.fixture
def road():
    """Opens games on a road of ten nodes, ten metres apart, with edges both ways.

    `road(anna=("red", 3, 4, 5))`: anna plays for red, begins on node 3 and goes to 4, then 5.
    """
    with ExitStack() as open_games:

        def open_one(*, seed=5, order=sorted, **agents):
            ctx = open_games.enter_context(gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}))
            ctx.graph.add_nodes(range(10), range(0, 100, 10), [0] * 10)
            ways = [(i, i + 1) for i in range(9)] + [(i + 1, i) for i in range(9)]
            ctx.graph.add_edges(range(18), *zip(*ways, strict=True))
            for name in order(agents):
                team, start, *nodes = agents[name]
                ctx.agent.create_agent(name, start_node_id=start, team=team, strategy=walk(*nodes))
            return ctx

        yield open_one
