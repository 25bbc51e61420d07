"""While agents decide, nothing tells them the seed, from which all draws of others follow."""

import copy
import pickle
from collections.abc import Mapping
from contextlib import suppress

import numpy as np
import pytest
from whole_world import world

from gamms import kernels
from gamms.core import draws
from gamms.game import IllegalMutation
from gamms.game.random_streams import Draws, DrawTable
from gamms.ir.game_state import GameState

SEED = 738291746102
DANGEROUS = ("human_input", "stay_open", "simulate")  # wait for people


def foretold(seed, turn, name, legal):
    """What an agent draws that chooses one of its legal nodes at random."""
    clock = GameState()
    clock.turn = turn
    return Draws(DrawTable(seed, clock), name).choice(legal)


def test_a_strategy_cannot_read_the_seed_that_foretells_draws_of_others(grid):
    with grid(side=5, seed=4) as ctx:
        seed, drawn = ctx.seed, []

        def other(state):
            state["action"] = state["draw"].choice(state["legal"])
            drawn.append((state["turn"], state["legal"], state["action"]))

        def cheat(state):
            state["action"] = state["curr_pos"]
            foretold(ctx.seed, state["turn"], "other", state["legal"])

        ctx.agent.create_agent("other", start_node_id=12, team="red", strategy=other)
        ctx.agent.create_agent("cheat", start_node_id=0, team="blue", strategy=cheat)
        ctx.game.on_error = "stay"
        played = ctx.game.run(5)
        assert [error["message"].split(":")[0] for error in played.errors] == ["IllegalMutation"] * 5
        assert "may not read ctx.seed" in played.errors[0]["message"]
        assert [foretold(seed, turn, "other", legal) for turn, legal, _ in drawn] == [node for *_, node in drawn]
        assert ctx.seed == played.seed == seed


def tells(value):
    if isinstance(value, bytes):
        return SEED.to_bytes(6, "little") in value or str(SEED).encode() in value
    return str(SEED) in str(value) if isinstance(value, (str, int, np.integer)) else False


def found_from(things):
    """Yield the paths by which public names, texts, copies and pickles of things lead to the seed."""
    queue, known = list(things.items()), []
    while queue:
        path, thing = queue.pop()
        if tells(thing):
            yield path
        if isinstance(thing, (str, bytes, int, float, type, np.ndarray, type(None))) or path.count(".") > 5:
            continue
        if any(thing is one for one in known):
            continue
        known.append(thing)
        for how in (repr, str, pickle.dumps, copy.copy, copy.deepcopy):
            with suppress(Exception):
                queue.append((f"{path}.{how.__name__}", how(thing)))
        if isinstance(thing, Mapping):
            queue += [(f"{path}.[{key!r}]", value) for key, value in thing.items()]
        elif isinstance(thing, (list, tuple)):
            queue += [(f"{path}.[{place}]", value) for place, value in enumerate(thing[:5])]
        if not type(thing).__module__.startswith("gamms"):
            continue
        for name in dir(thing):
            if name[0] != "_" and name not in DANGEROUS:
                with suppress(Exception):
                    value = getattr(thing, name)
                    queue.append((f"{path}.{name}", value() if callable(value) else value))


def test_no_public_name_text_copy_or_pickle_tells_the_seed():
    found = []

    def look(ctx, state):
        if ctx.game.turn == 1:
            found.extend(found_from({"state": state, "ctx": ctx}))

    with world(look) as ctx:
        ctx.reseed(SEED)
        assert repr(ctx).startswith(f"Context(seed={SEED}, ")
        ctx.game.run(2)
        assert ctx.game.turn == 2
    assert found == []


def test_a_strategy_may_be_made_by_the_seed(grid):
    with grid(side=5, seed=4) as ctx:

        def made(ctx):
            rng = ctx.stream("mine", ctx.seed)

            def strategy(state):
                state["action"] = state["legal"][rng.integers(len(state["legal"]))]
                assert state["fork"](7) is not None

            return strategy

        ctx.agent.create_agent("a", start_node_id=0, strategy=made(ctx))
        ctx.game.run(2)


def test_refusals_say_that_agents_decide(grid):
    with grid(side=5, seed=4) as ctx:

        def strategy(state):
            for read in (lambda: ctx.seed, ctx.rng_state, lambda: ctx.stream("agent", "a"), ctx.game.result):
                with pytest.raises(IllegalMutation, match="while agents decide"):
                    read()
            state["action"] = 0

        ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
        assert ctx.game.run(1).seed == 4


def unmixed(bits):
    """Return what the finalizer of SplitMix64 made these bits of."""
    bits ^= bits >> 31 ^ bits >> 62
    bits = bits * pow(0x94D049BB133111EB, -1, 1 << 64) % (1 << 64)
    bits ^= bits >> 27 ^ bits >> 54
    bits = bits * pow(0xBF58476D1CE4E5B9, -1, 1 << 64) % (1 << 64)
    return bits ^ bits >> 30 ^ bits >> 60


def test_an_agent_can_compute_its_own_key_and_no_key_of_its_purpose(grid):
    gamma = 0x9E3779B97F4A7C15
    drawn = {}

    def tell(state):
        drawn[state["name"]] = state["draw"].bits()
        state["action"] = state["curr_pos"]

    with grid(side=3, seed=SEED) as ctx:
        for name in ("cheat", "other"):
            ctx.agent.create_agent(name, start_node_id=0, strategy=tell)
        ctx.game.step()
    first = unmixed((unmixed(drawn["cheat"]) - gamma) % (1 << 64))
    purpose = kernels.compute_purpose_key(SEED, "agent")
    names = {name: kernels.compute_name_key(name) for name in drawn}
    assert first == kernels.compute_first_key(purpose, names["cheat"])
    # As long as a first key was `mix(purpose ^ name)`, this was the key of all agents.
    computed = unmixed(first) ^ names["cheat"]
    assert computed != purpose
    for of_other in (kernels.compute_first_key(computed, names["other"]), draws.mix(computed ^ names["other"])):
        assert kernels.compute_bits(kernels.compute_turn_key(of_other, 0), 0) != drawn["other"]
