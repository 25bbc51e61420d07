"""A context on a road of ten nodes, and moves on it."""

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
