"""What array forms get has the public names that the page on them has, and no others."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import gamms
from gamms.scenario import Scenario

PAGE = (Path(__file__).parents[2] / "docs" / "array_forms.md").read_text(encoding="utf-8")
WALK = "gamms.strategies:random_walk"
SCENE = Scenario(map={"grid": {"width": 3, "height": 3}}, teams={"red": {"count": 2, "strategy": WALK}})
PLAYS = {
    "in a game alone": lambda ctx: ctx.game.run().reason == "seen",
    "in a batch": lambda ctx: played(ctx.game.batch(2)),
}


def section(title):
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def described(title):
    """Return the names in the first column of the table of a section."""
    text = section(title)
    return {
        name
        for cell in re.findall(r"^\| (`.*?`) \|", text, re.MULTILINE)
        for name in re.findall(r"`(\w+)\b(?!\[)", cell)
    }


def played(games):
    """Return whether the first game has ended after a turn that was played in arrays."""
    games.step()
    return not games.detached and games.is_over[0]


def public(shown):
    return {name for name in dir(shown) if not name.startswith("_")}


@pytest.mark.parametrize("play", PLAYS.values(), ids=PLAYS)
def test_a_view_has_the_names_that_the_page_has(play):
    names = described("What a view has")

    @gamms.array_strategy
    def look(view):
        assert public(view) - {*dir(Mapping)} == names
        return np.zeros_like(view.node)

    @gamms.array_rule
    def end(turn):
        turn.end([0], "seen", [None])

    with SCENE.build(seed=1, strategies={"red": look}) as ctx:
        ctx.game.add(end)
        assert play(ctx)


@pytest.mark.parametrize("play", PLAYS.values(), ids=PLAYS)
def test_a_turn_has_the_names_that_the_page_has(play):
    names = described("A rule in arrays")

    @gamms.array_rule
    def look(turn):
        assert public(turn) == names
        turn.end([0], "seen", [None])

    with SCENE.build(seed=1) as ctx:
        ctx.game.add(look)
        assert play(ctx)
