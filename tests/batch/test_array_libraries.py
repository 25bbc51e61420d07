"""Batches in arrays of other libraries: the same games, and tensors in and out.

NumPy passed as `xp=` plays the same code; what needs another library is skipped where that is not installed.
"""

import gc
from typing import Any, NamedTuple

import numpy as np
import pytest
from batch_scenes import plain, scene
from hypothesis import given, settings
from hypothesis import strategies as st
from random_games import games
from test_laws import LAWS
from test_roads import hole
from test_strategies import MADE, hunted

import gamms
from gamms import kernels
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.game import IllegalAction
from gamms.game.batch.device import DeviceEngine
from gamms.game.batch.device_view import nodes_of_all
from gamms.game.batch.roads import NeedsOneMap
from gamms.strategies import random_walk

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
LIMIT = {"rule": "time_limit", "with": {"turns": 12}}
IN_NUMPY = {"guard", "safest_exit", "assign", "intercept", "sweep", "follow_belief"}  # the first words of names
NAMES = ["numpy", "torch", "array_api_strict", "array_api_strict on device1"]  # which others cannot read, as a GPU


class Place(NamedTuple):
    """An array library, and where it puts the arrays of a batch."""

    xp: Any
    device: Any

    @property
    def options(self):
        return {"xp": self.xp, "device": self.device}

    @property
    def kind(self):
        return type(self.xp.asarray([0]))

    def put(self, array):
        return self.xp.asarray(array, device=self.device)

    def read(self, tensor):
        is_there = self.device is not None and isinstance(tensor, self.kind)
        return np.asarray(tensor.to_device(self.xp.Device("CPU_DEVICE")) if is_there else tensor)


@pytest.fixture(params=NAMES)
def place(request):
    return place_of(library(request.param.split()[0]), request.param)


def place_of(xp, name):
    return Place(xp, xp.Device("device1") if name.endswith("device1") else None)


def library(name):
    return pytest.importorskip(name, reason=f'{name} is not installed: pip install ".[torch]", or make test-torch')


def installed():
    found = []
    for name in NAMES:
        try:
            found.append(place_of(__import__(name.split()[0]), name))
        except ImportError:
            continue
    return found


@settings(LAWS, max_examples=7)
@given(
    drawn=games(),
    seeds=st.lists(st.integers(0, 2**62), min_size=1, max_size=3),
    restart=st.tuples(st.integers(0, 9), st.integers(0, 2)),
    place=st.sampled_from(installed()),
)
def test_a_batch_of_any_library_is_that_of_numpy(drawn, seeds, restart, place):
    results = []
    for chosen in ({}, place.options):
        with drawn.open() as ctx, ctx.game.batch(seeds=seeds, most_agents=drawn.reserved, **chosen) as played:
            try:
                for _ in range(restart[0]):
                    played.step()
                played.reset([restart[1] % len(seeds)])
                played.run()
                results.append([plain(played.result(number)) for number in range(len(seeds))])
            except IllegalAction as error:
                results.append([str(error), error.__notes__])
    assert results[0] == results[1]


@pytest.mark.parametrize("name", MADE)
def test_strategies_play_the_same_in_any_library(name, place):
    results = []
    conflicts = {"conflicts": {"capacity": 1}} if name == "unblock" else {}
    for chosen in ({}, place.options):
        strategies = {"red": MADE[name], "blue": MADE[name]}
        with hunted(**conflicts).batch(3, seed=1, strategies=strategies, **chosen) as games:
            for _ in range(6):
                games.step()
            games.reset([1])
            games.run()
            results.append([plain(games.result(number)) for number in range(3)])
            if chosen and name.split()[0] not in IN_NUMPY:
                assert all(hasattr(agent.strategy.array_form, "portable_form") for agent in games._roster.agents)
    assert results[0] == results[1]


@pytest.mark.parametrize("name", ["goto", "patrol", "random_waypoints", "chase", "flee"])
@pytest.mark.parametrize("on_host", [True, False])
def test_routes_of_large_maps_are_learned_as_they_are_asked_for(name, on_host, monkeypatch):
    monkeypatch.setattr("gamms.game.batch.device_view._ALL_AT_FIRST", 0)
    xp = np if on_host else library("torch")
    strategies = {"red": MADE[name], "blue": MADE[name]}
    with hunted().batch(3, seed=1, strategies=strategies) as games:
        games.run()
        results = [plain(games.result(number)) for number in range(3)]
    with hunted().batch(3, seed=1, strategies=strategies, xp=xp) as games:
        games.library.on_host = on_host  # else as if it were a GPU
        games.run()
        assert [plain(games.result(number)) for number in range(3)] == results


def test_actions_go_in_and_all_that_a_policy_needs_comes_out_as_tensors(place):
    with (
        scene([TAG, LIMIT]).batch(4, seed=1, **place.options) as games,
        scene([TAG, LIMIT]).batch(4, seed=1) as plain_games,
    ):
        tensor = place.kind
        for _ in range(12):
            view, other = games.observe("red"), plain_games.observe("red")
            for key in ("curr_pos", "legal", "mask", "turn", "xy", "edge", "offset_m"):
                assert isinstance(view[key], tensor)
                assert place.read(view[key]).tolist() == other[key].tolist(), key
            going = games.step({"red": view.draw.below(view.counts)})
            plain_games.step({"red": other.draw.below(other.counts)})
            assert isinstance(going, tensor)
        for name in ("is_over", "terminated", "truncated", "turn"):
            assert isinstance(getattr(games, name), tensor)
            assert place.read(getattr(games, name)).tolist() == getattr(plain_games, name).tolist()
        assert {key: place.read(one).tolist() for key, one in games.scores.items()} == {
            key: one.tolist() for key, one in plain_games.scores.items()
        }
        assert [plain(games.result(i)) for i in range(4)] == [plain(plain_games.result(i)) for i in range(4)]


def test_what_sensors_show_comes_out_as_tensors(place):
    with hunted().batch(3, **place.options) as games, hunted().batch(3) as plain_games:
        for _ in range(6):
            games.step()
            plain_games.step()
        view, other = games.observe("red"), plain_games.observe("red")
        assert place.read(view.sees()).tolist() == place.read(view.sees("near")).tolist() == other.sees().tolist()
        for found, expected in (
            (view.seen(), other.seen()),
            (view.enemies(), other.enemies()),
            (view.mates(), other.mates()),
        ):
            assert [place.read(column).tolist() for column in found[1:]] == [one.tolist() for one in expected[1:]]
        for column, expected in zip(view.vector(), other.vector(), strict=True):
            assert place.read(column).tolist() == np.asarray(expected).tolist()
        for key in ("living", "is_there"):
            assert place.read(getattr(view, key)).tolist() == getattr(other, key).tolist()
        assert place.read(view.covered()).tolist() == other.covered().tolist()
        node = place.put(other.node)
        assert place.read(view.towards(node * 0 + 5)).tolist() == other.towards(other.node * 0 + 5).tolist()


def test_flows_take_and_give_tensors(place):
    with hunted().batch(3, **place.options) as games, hunted().batch(3) as plain_games:
        view, other = games.observe("red"), plain_games.observe("red")
        (flows, node), (plain_flows, row) = (view.flows(), view.node), (other.flows(), other.node)
        masses = np.full((3, len(other.streets.counts)), 0.5)
        for found, expected in (
            (flows.walks(node, 4), plain_flows.walks(row, 4)),
            (flows.within(node, 10.0), plain_flows.within(row, 10.0)),
            (flows.edges(node, node), plain_flows.edges(row, row)),
            (flows.diffuse(place.put(masses)), plain_flows.diffuse(masses)),
        ):
            assert isinstance(found, place.kind)
            assert place.read(found).tolist() == expected.tolist()


def test_a_view_knows_the_actions_that_lead_to_nodes(place):
    with scene().batch(3, **place.options) as games, scene().batch(3) as plain_games:
        view, other = games.observe("red"), plain_games.observe("red")
        wanted = other["legal"][:, :, 1]
        assert place.read(view.action_to(place.put(wanted))).tolist() == other.action_to(wanted).tolist()
        assert place.read(view.action_to(7)).tolist() == other.action_to(7).tolist()
        with pytest.raises(UnknownName, match="Unknown node 999"):
            view.action_to(place.put(wanted * 0 + 999))
        with pytest.raises(BadValue, match="nodes has the shape"):
            view.action_to(place.put(np.zeros(2, np.int64)))


STREETS = [
    ("ids", np.array([0, 24, 7])),
    ("ids", np.array([3, 25])),
    ("ids", np.array([0.5])),
    ("rows", np.array([[1, 2], [3, 24]])),
    ("rows", np.array([1, 99])),
    ("rows", np.array([-1])),
    ("step", np.array([0, 6, 24]), np.array([2, 4, 0])),
    ("step", np.array([0, 6]), np.array([3, 0])),
    ("step", np.array([0, -1]), np.array([0, 0])),
    ("step", np.array([0, 1]), np.array([-1, 0])),
    ("step", np.array([0, 1]), np.array([0.0, 0.0])),
    ("step", np.array([0, 1]), np.array([1])),
    ("step", np.array([0, 1]), np.array([1, 1, 1])),
    ("action_to", np.array([0, 6]), np.array([1, 9])),
    ("action_to", np.array([0, 25]), np.array([1, 9])),
    ("action_to", np.array([0, 6], np.int32), np.array([1, -3])),
]


def outcome(call, read):
    """Return what a call gives, as lists, or the class and the message of what it raises."""
    try:
        return read(call()).tolist()
    except GammsError as error:
        return type(error), str(error)


@pytest.mark.parametrize(("verb", "given"), [(verb, given) for verb, *given in STREETS])
def test_streets_take_and_refuse_the_same_in_any_library(place, verb, given):
    with scene().batch(2, **place.options) as games, scene().batch(2) as plain_games:
        there, here = games.observe("red").streets, plain_games.observe("red").streets
        found = outcome(lambda: getattr(there, verb)(*map(place.put, given)), place.read)
        assert found == outcome(lambda: getattr(here, verb)(*given), np.asarray)


ROUTES = [
    (np.array([0, 24]), np.array([7, 3])),
    (np.array([[0], [24]]), np.array([7, 3, 24])),
    (np.array([0, 1]), np.array([3, -1])),
    (np.array([0, 25]), np.array([3, 1])),
    (np.array([0, 1]), np.array([3.0, 1.0])),
]


@pytest.mark.parametrize("verb", ["distances", "actions"])
@pytest.mark.parametrize(("sources", "targets"), ROUTES)
def test_routes_take_and_refuse_the_same_in_any_library(place, verb, sources, targets):
    with scene().batch(1, **place.options) as games, scene().batch(1) as plain_games:
        there, here = games.observe("red").routes(), plain_games.observe("red").routes()
        found = outcome(lambda: getattr(there, verb)(place.put(sources), place.put(targets)), place.read)
        assert found == outcome(lambda: getattr(here, verb)(sources, targets), np.asarray)


def test_the_view_of_other_agents_is_the_same_in_any_library(place):
    with scene().batch(2, **place.options) as games, scene().batch(2) as known:
        games.step()
        known.step()
        there, here = (batch.observe("red").of(np.arange(6)) for batch in (games, known))
        assert place.read(there["curr_pos"]).tolist() == here["curr_pos"].tolist()
        assert place.read(there.draw.random()).tolist() == here.draw.random().tolist()
        with pytest.raises(BadValue, match=r"view\.on_host\(\)\.in_games"):
            there.in_games(np.array([0]))


def test_streets_read_one_number_to_check_what_a_strategy_passes(place):
    with scene().batch(2, **place.options) as games:
        view = games.observe("red")
        before = games.library.num_reads
        view["curr_pos"], view["legal"]
        assert games.library.num_reads == before
        view.streets.step(view.node, view.counts - 1)
        assert games.library.num_reads == before + 1


@pytest.mark.parametrize("phase", ["before", "after"])
def test_games_are_played_in_numpy_once_roads_are_closed(place, phase):
    patrol = {"function": "gamms.strategies:patrol", "with": {"nodes": [0, 12, 20]}}
    scenario, results, shown = scene([TAG]).replace(**{"teams.red.strategy": patrol}), [], []
    for chosen in ({}, place.options):
        with scenario.build(seed=1) as ctx:
            ctx.game.add(hole, phase=phase)
            with ctx.game.batch(seeds=[1, 2, 3], **chosen) as games:
                for turn in range(8):
                    assert turn > 1 or "closed roads" not in (games.slow or "")
                    if turn == 7:
                        games.reset([1])
                    view = games.observe("blue")
                    games.step({"blue": view.draw.below(view.counts)}, on_illegal="stay")
                view = games.observe("red")
                with pytest.raises(NeedsOneMap, match=r"view\.in_games"):
                    _ = view.streets.counts
                with pytest.raises(NeedsOneMap, match=r"view\.in_games"):
                    view.routes().distances(view.node, view.node)
                shown.append([place.read(one).tolist() for one in (*view.legal_rows(), view.action_to(7), view["xy"])])
                games.run()
                results.append([plain(games.result(number)) for number in range(3)])
                is_copied = chosen and not games.library.on_host
                assert games.slow == (
                    f"closed roads, which NumPy plays: {games.library} gets copies" if is_copied else None
                )
    assert results[0] == results[1]
    assert shown[0] == shown[1]


def test_games_that_leave_the_arrays_of_any_library_are_those_of_numpy(place):
    close = gamms.array_rule(lambda turn: turn.close_roads(np.flatnonzero((turn.turn == 3) & (turn.seeds > 1)), [3, 8]))
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 15.0}}
    team = {"count": 2, "strategy": "gamms.strategies:follow_belief", "sensors": ["near"]}
    results = []
    for chosen in ({}, place.options):
        with scene([TAG], teams={"red": team, "blue": team}, sensors=near).build(seed=1) as ctx:
            ctx.game.add(close, phase="before", name="close")
            with ctx.game.batch(seeds=[1, 2], **chosen) as games:
                for _ in range(6):
                    games.step({"blue": games.observe("blue").turn[:, None] % games.observe("blue").counts})
                assert "roads were closed" in games.detached[0]
                games.reset([0])
                games.run()
                results.append([plain(games.result(number)) for number in range(2)])
    assert results[0] == results[1]


def test_what_is_observed_of_games_that_numpy_plays_is_that_of_numpy(place):
    scenario, shown = scene().replace(**{"teams.red.speed": 2.0}), []
    for chosen in ({}, place.options):
        with scenario.batch(2, **chosen) as games:
            view = games.observe("red")
            shown.append([place.read(one).tolist() for one in (*view.legal_rows(), view.towards(view.node * 0 + 24))])
    assert shown[0] == shown[1]


def test_given_actions_are_kept_for_recordings(place, tmp_path):
    files = []
    for name, chosen in (("numpy.ggr", {}), ("other.ggr", place.options)):
        with scene([LIMIT]).batch(2, seed=5, record=True, **chosen) as games:
            while not bool(place.xp.all(games.is_over) if chosen else games.is_over.all()):
                view = games.observe("blue")
                games.step({"blue": view.turn[:, None] % view.counts})
            games.record(1, tmp_path / name)
        gc.collect()
        files.append((tmp_path / name).read_bytes())
    assert files[0] == files[1]


def test_turns_without_contacts_read_no_agents(place):
    with scene([LIMIT], side=9).batch(50, **place.options) as games:
        games.run()
        assert games.library.num_reads == 0
    with scene([TAG, LIMIT], side=30).batch(2, **place.options) as games:
        games.run()
        events = sum(len(games.result(i).events) for i in range(2))
        assert games.library.num_reads <= 12 + 5 + 2 * events


def test_draws_are_the_same_bits_in_any_library(place):
    seeds, turns = np.random.default_rng(0).integers(0, 2**63, (7, 5)).astype(np.uint64) * 2 + 1, np.arange(7)
    space = place.xp if place.xp.__name__ != "torch" else pytest.importorskip("array_api_compat.torch")
    first, there = place.put(kernels.as_signed(seeds)), place.put(turns)[:, None]
    keys, other = kernels.later_keys_signed(first, there), kernels.later_key_rows(seeds, turns[:, None])
    assert place.read(keys).tolist() == kernels.as_signed(other).tolist()
    for k in (0, 3):
        bits, others = kernels.bits_at_signed(keys, k), kernels.bits_at_rows(other, k)
        assert place.read(bits).tolist() == kernels.as_signed(others).tolist()
        for n in (1, 7, 2**31, 2**32):
            assert place.read(kernels.below_signed(bits, n)).tolist() == kernels.below_many(others, n).tolist()
        assert place.read(kernels.fraction_signed(bits, space)).tolist() == kernels.fraction_many(others).tolist()


def test_what_has_no_form_for_the_library_is_played_in_numpy_with_tensors_in_and_out(place):
    def wander(state):
        state["action"] = state["legal"][-1]

    with scene([TAG, LIMIT]).batch(2, **place.options, strategies={"red": wander}) as games:
        assert "wander" in games.slow
        view = games.observe("blue")
        games.step({"blue": view.counts - 1})
        assert place.read(games.turn).tolist() == [1, 1]
        assert isinstance(games.observe("blue")["xy"], place.kind)


def test_a_form_in_numpy_plays_in_a_batch_of_any_library(place):
    def last(state):
        state["action"] = state["legal"][-1]

    last.array_form = lambda view: np.where(view.mask, view.counts - 1, 0)
    with scene([TAG, LIMIT]).batch(3, **place.options, strategies={"red": last}) as games:
        games.run()
        for number in range(3):
            assert plain(games.result(number)) == plain(scene([TAG, LIMIT]).play(seed=number, strategies={"red": last}))


def test_a_portable_form_gets_tensors(place):
    kind = place.kind

    def last(state):
        state["action"] = state["legal"][-1]

    def form(view):
        assert isinstance(view.counts, kind)
        return view.xp.where(view.mask, view.counts - 1, 0)

    last.array_form = gamms.portable_form(form)
    with scene([TAG, LIMIT]).batch(3, **place.options, strategies={"red": last}) as games:
        games.run()
        assert plain(games.result(1)) == plain(scene([TAG, LIMIT]).play(seed=1, strategies={"red": last}))


def test_what_a_portable_form_writes_into_its_view_moves_nobody(place):
    if place.device is not None:
        pytest.skip("its arrays cannot be written to in this way")

    @gamms.array_strategy
    @gamms.portable_form
    def cheat(view):
        view.node[...] = 0
        view.mask[...] = False
        view.turn[...] = 7
        view.living[...] = False
        nodes_of_all(view)[...] = 0
        return view.xp.zeros_like(view.turn)[:, None] + view.xp.zeros_like(view.node)

    still = {"red": gamms.strategies.stay, "blue": gamms.strategies.stay}
    with (
        scene([TAG, LIMIT]).batch(3, **place.options, strategies={**still, "red": cheat}) as games,
        scene([TAG, LIMIT]).batch(3, strategies=still) as known,
    ):
        for one in (games, known):
            one.step()
        games.observe("red").node[...] = 0
        games.observe("red").mask[...] = False
        for one in (games, known):
            one.run()
        assert [plain(games.result(i)) for i in range(3)] == [plain(known.result(i)) for i in range(3)]


@pytest.mark.parametrize("nothing", [None, "stay", [[0], [0, 0]]])
def test_a_portable_form_that_returns_no_numbers_is_named(place, nothing):
    @gamms.array_strategy
    @gamms.portable_form
    def forgets(_):
        return nothing

    with scene().batch(2, **place.options, strategies={"red": forgets}) as games:
        with pytest.raises(BadType, match="forgets: actions are an array of numbers, not"):
            games.step()
        assert place.read(games.turn).tolist() == [0, 0]


def test_illegal_actions_name_the_agent_and_no_game_is_played(place):
    with scene().batch(2, **place.options) as games:
        wrong = games.observe("red").counts
        with pytest.raises(BadValue, match="of agent 'red_0' in game 0, turn 0, is not the number of a legal node"):
            games.step({"red": wrong})
        with pytest.raises(BadValue, match="one action for each game and agent"):
            games.step({"red": wrong[:1, :]})
        with pytest.raises(BadType, match="numbers of legal nodes"):
            games.step({"red": place.put(np.zeros((2, 3)))})
        assert place.read(games.turn).tolist() == [0, 0]


def test_arrays_of_another_library_are_refused():
    torch = library("torch")
    with scene().batch(2, xp=torch) as games, pytest.raises(BadType, match="give an array of torch on cpu"):
        games.step({"red": np.zeros((2, 3), np.int64)})
    with scene().batch(2, xp=np) as games, pytest.raises(BadType, match="give an array of numpy on cpu"):
        games.step({"red": torch.zeros((2, 3), dtype=torch.int64)})


@pytest.mark.parametrize("wrong", ["torch", 7, gamms])
def test_what_is_no_array_library_is_refused(wrong):
    with pytest.raises(BadType, match="module of an array library"):
        scene().batch(2, xp=wrong)


def test_a_device_that_is_not_there_is_refused(place):
    with pytest.raises(BadValue, match="Give a device that is there"):
        scene().batch(2, xp=place.xp, device="warp drive")
    with pytest.raises(BadValue, match="device='cuda' needs an array library"):
        scene().batch(2, device="cuda")


def test_a_device_without_memory_is_refused():
    with pytest.raises(BadValue, match=r"device='meta' cannot hold .* \(torch: Cannot copy out of meta tensor"):
        scene().batch(2, xp=library("torch"), device="meta")


def test_games_are_played_on_the_device(place):
    with gamms.create_context() as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
        ctx.agent.create_agent("a", start_node_id=0, strategy=random_walk)
        ctx.game.max_turns = 3
        with ctx.game.batch(2, **place.options) as games:
            assert isinstance(games._engine, DeviceEngine)
            games.run()
            assert place.read(games.truncated).tolist() == [True, True]
            assert f"of {place.xp.__name__} on" in repr(games)
