"""The probabilities of targets in many games at once are those of a filter of each game."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.belief import Filter, GamesFilter, random_walk, to_goals
from gamms.errors import BadType, BadValue


def street(ctx):
    """Five nodes in a line with one more beside them, whose ids are not their rows."""
    for node in range(6):
        ctx.graph.graph.add_node({"id": 10 - node, "x": float(node), "y": 0.0})
    pairs = [(10, 9), (9, 8), (8, 7), (7, 6), (8, 5)]
    for number, (one, other) in enumerate([*pairs, *[pair[::-1] for pair in pairs]]):
        ctx.graph.graph.add_edge({"id": number, "source": one, "target": other, "length": 2.0})
    return ctx.graph.columns()


@given(
    games=st.lists(
        st.tuples(
            st.dictionaries(st.integers(0, 5), st.sampled_from([0.4, 1.0]), max_size=5),
            st.lists(st.integers(-1, 5), min_size=2, max_size=2),
            st.lists(st.booleans(), min_size=2, max_size=2),
        ),
        min_size=1,
        max_size=4,
    ),
    model=st.sampled_from([random_walk(), random_walk(0.2, steps=2), to_goals([6, 5], wander=0.2)]),
    metres=st.sampled_from([None, 0.7]),
    turns=st.integers(1, 3),
)
def test_each_game_has_the_probabilities_of_a_filter_of_its_own(games, model, metres, turns):
    with gamms.create_context(seed=1) as ctx:
        columns = street(ctx)
        ids = columns.node_ids
        together = GamesFilter(columns, model, len(games), 2, metres=metres)
        alone = [Filter(ctx, model, ["a", "b"], metres=metres) for _ in games]
        seen, found = np.zeros((len(games), 6)), np.array([rows for _, rows, _ in games])
        hidden = np.array([flags for _, _, flags in games]) & (found < 0)
        for line, (chances, _, _) in enumerate(games):
            seen[line, [*chances]] = [*chances.values()]
        for _ in range(turns):
            together.predict()
            totals = together.update(seen, found, hidden)
            for line, (filter, (chances, rows, _)) in enumerate(zip(alone, games, strict=True)):
                filter.predict()
                expected = filter.update(
                    ids[[*chances]] if chances else [],
                    [*chances.values()],
                    {name: int(ids[row]) for name, row in zip("ab", rows, strict=True) if row >= 0},
                    [name for name, flag in zip("ab", hidden[line], strict=True) if flag],
                )
                assert totals[line].tolist() == expected.tolist()
                assert together.probabilities()[line].tolist() == filter.probabilities().tolist()


def test_a_game_that_begins_again_forgets_where_its_targets_were():
    with gamms.create_context(seed=1) as ctx:
        filter = GamesFilter(street(ctx), random_walk(), 3)
        filter.update(np.zeros((3, 6)), np.array([[2], [3], [4]]))
        assert filter.probabilities()[:, 0].argmax(axis=1).tolist() == [2, 3, 4]
        filter.reset(np.array([0, 2]))
        assert filter.probabilities()[[0, 2]].tolist() == np.full((2, 1, 6), 1 / 6).tolist()
        assert filter.probabilities()[1, 0, 3] == 1.0


def test_arrays_of_other_shapes_are_refused():
    with gamms.create_context(seed=1) as ctx:
        filter = GamesFilter(street(ctx), random_walk(), 3)
        with pytest.raises(BadValue, match=r"seen needs the shape \(3, 6\)"):
            filter.update(np.zeros((6, 3)))
        with pytest.raises(BadType, match=r"ctx.graph.columns\(\), not GraphEngine"):
            GamesFilter(ctx.graph, random_walk(), 3)
        with pytest.raises(BadValue, match=r"found needs the shape \(3, 1\)"):
            filter.update(np.zeros((3, 6)), np.zeros(3, np.int64))
        with pytest.raises(BadValue, match="found has row 6, but the map has 6 nodes, from 0"):
            filter.update(np.zeros((3, 6)), np.array([[5], [6], [-1]]))
        assert GamesFilter(street(gamms.create_context()), random_walk(), 0, 2).probabilities().shape == (0, 2, 6)
        with pytest.raises(BadValue, match="seen must be from 0 to 1, not 2"):
            filter.update(np.full((3, 6), 2.0))
