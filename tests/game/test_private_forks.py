"""`state["fork"]`: copies of the game to look ahead in, which have what an agent knows and nothing else."""

import pickle
from copy import deepcopy

import pytest

import gamms
from gamms.errors import BadValue, IllegalMutation
from gamms.ir.game_state import FIELDS


def walk(state):
    state["memory"]["visits"] = [*state["memory"].get("visits", []), state["curr_pos"]]
    state["action"] = state["draw"].choice(state["legal"])


def stay_all(states):
    for state in states.values():
        state["action"] = state["curr_pos"]


@pytest.fixture
def world():
    """A grid on which ann of the team red asks for a fork in each turn; `world.forks` has what it got."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.forks = []

        def ask(state):
            ctx.forks.append(state["fork"](7))
            walk(state)

        places = {"ann": ("red", 0, ask), "amy": ("red", 4, walk), "bob": ("blue", 20, walk), "cat": ("blue", 24, walk)}
        for name, (team, node, strategy) in places.items():
            eyes = ctx.sensor.create_sensor(f"eyes of {name}", "agent_range", sensor_range=5.0)
            ctx.agent.create_agent(
                name, start_node_id=node, team=team, strategy=strategy, sensors={"eyes": eyes}, speed=2, meta={"hp": 1}
            )
        ctx.game.channels = {"radio": {"range_m": 1000.0, "delay_turns": 3}}
        yield ctx


def parts_of(fork):
    """All that can be read of a fork."""
    ctx, state = fork.game.ctx, fork.game.internals.state
    agents = list(ctx.agent.create_iter())
    parts = {
        **{name: list(getattr(ctx.agent.block, name)) for name in ("node", "previous", "speed", "alive", "heading")},
        **{name: getattr(state, name) for name in ("events", "errors", "deeds", "messages", "memories")},
        **{name: getattr(state, name) for name in ("facts", "agent_facts", "team_facts", "data", "scores", "began")},
        "team_memories": (state.team_memories, dict(state.blocked)),
        "sensors": ([sensor.data for sensor in ctx.sensor.sensors.values()], ctx.sensor.storage.describe_sensors()),
        "attributes": [(dict(one.__dict__), one.strategy) for one in agents],
        "states": [{key: one.state[key] for key in one.state if key not in ("draw", "rng")} for one in agents],
        "settings": fork.game.plain_settings(),
        "collected": fork.game.result().collected,
        "draws": (ctx.seed, [fork.game.observation(one)["draw"].bits() for one in agents]),
    }
    return {name: repr(part) for name, part in parts.items()}


HIDDEN = {
    "a place": lambda ctx: setattr(ctx.agent.get_agent("bob"), "current_node_id", 22),
    "a speed": lambda ctx: setattr(ctx.agent.get_agent("bob"), "speed", 3),
    "an attribute": lambda ctx: ctx.agent.get_agent("bob").meta.update(hp=0),
    "a new attribute": lambda ctx: setattr(ctx.agent.get_agent("bob"), "role", "spy"),
    "a heading": lambda ctx: setattr(ctx.agent.get_agent("bob"), "orientation", (0.0, 1.0)),
    "a strategy": lambda ctx: ctx.agent.get_agent("bob").register_strategy(lambda state: state.update(action=0)),
    "a plan": lambda ctx: ctx.game.command("blue", stay_all),
    "a memory": lambda ctx: ctx.game.memories["bob"].update(secret=1),
    "the memory of a team": lambda ctx: ctx.game.team_memories.update(blue={"secret": 1}),
    "a fact for an agent": lambda ctx: ctx.game.publish(to="bob", word="fox"),
    "a fact for a team": lambda ctx: ctx.game.publish(to="blue", word="fox"),
    "what a rule remembers": lambda ctx: ctx.game.data.update(secret=1),
    "a range": lambda ctx: setattr(ctx.sensor.get_sensor("eyes of bob"), "range", 2.0),
    "the seed": lambda ctx: ctx.reseed(99),
    "what was collected": lambda ctx: ctx.game.collect("where", lambda agent: agent.current_node_id, per="agent"),
    "a message under way": lambda ctx: ctx.game.messages.append(
        {"turn": 1, "channel": "radio", "sender": "bob", "to": "blue", "body": 1, "size": 1, "heard": {"cat": 4}}
        | {"overheard": {"ann": 4}, "lost": [], "jammed": []}
    ),
}


@pytest.mark.parametrize("change", HIDDEN.values(), ids=HIDDEN)
def test_secrets_change_nothing_in_the_fork_of_an_agent(world, change):
    world.game.step()
    here = world.game.snapshot()
    world.game.step()
    world.game.restore(here)
    change(world)
    world.game.step()
    _, first, second = world.forks
    before, after = parts_of(first), parts_of(second)
    assert [(name, before[name][:300], after[name][:300]) for name in before if before[name] != after[name]] == []


def test_the_knowledge_of_an_agent_is_in_its_fork(world):
    world.game.data["secret"] = 1
    world.game.step()
    world.game.publish(word="fox")
    world.game.publish(to="red", word="owl")
    world.game.publish(to="ann", number=3)
    world.game.scores["red"] += 2
    world.game.team_memories["red"] = {"seen": 4}
    world.game.eliminate("cat")
    own = world.agent.get_agent("ann")
    own.meta["hp"], place = 9, own.current_node_id
    world.game.step()
    game = world.forks[1].game
    state = game.observation("ann")
    assert (state["curr_pos"], state["turn"], state["team_memory"]) == (place, 1, {"seen": 4})
    assert dict(state["facts"]) == {"word": "owl", "number": 3}
    assert state["memory"]["visits"] == [0]
    assert (game.scores["red"], game.ctx.agent.get_agent("ann").meta) == (2, {"hp": 9})
    assert [agent.name for agent in game.agents] == ["amy", "ann", "bob"]
    assert [event["kind"] for event in game.events] == ["eliminated"]


def test_agents_know_these_fields_of_a_game_alone():
    known = {name: field.axis for name, field in FIELDS.items() if field.axis is not None}
    assert known == {
        **dict.fromkeys(["turn", "last_turn", "over", "scores", "facts"], "game"),
        **dict.fromkeys(["agent_facts", "memories", "counts", "blocked", "named_edges", "driven"], "agent"),
        **dict.fromkeys(["team_facts", "team_memories"], "team"),
    }


def test_rules_draw_secrets_again_and_disclose_the_rest(world):
    def treasure(ctx):
        pass

    def hide(ctx):
        ctx.game.data["treasure"] = int(ctx.stream("treasure").integers(1 << 30))

    treasure.prepare = hide
    world.game.add(treasure)
    world.game.add(gamms.rules.capture_flag({"red": 0, "blue": 24}, goal=None))
    world.game.run(3)
    forks = [fork.game for fork in world.forks]
    assert forks[0].data["treasure"] == forks[2].data["treasure"] != world.game.data["treasure"]
    world.game.data["flags"]["captures"]["red"] = 5
    world.game.step()
    assert world.forks[3].game.data["flags"]["captures"] == {"red": 5}


def test_a_resource_is_known_to_its_agent_alone(world):
    world.game.add(gamms.rules.resource("fuel", 10.0, per_turn=1.0))
    world.game.run(3)
    assert world.forks[2].game.data["resources"]["fuel"]["amounts"] == {
        "ann": 8.0,
        "amy": 10.0,
        "bob": 10.0,
        "cat": 10.0,
    }


def test_full_information_has_to_be_allowed(world):
    def look(state):
        world.forks.append(state["fork"](7, information="full"))
        walk(state)

    world.agent.get_agent("ann").register_strategy(look)
    with pytest.raises(BadValue, match=r"settings: \{information: full\}"):
        world.game.step()
    world.game.information = "full"
    world.game.run(2)
    bob = world.agent.get_agent("bob")
    fork = world.forks[-1].game
    assert fork.ctx.agent.get_agent("bob").current_node_id == bob.prev_node_id
    assert fork.memories["bob"] == {"visits": [20]}
    assert fork.ctx.seed != world.seed
    assert "full information" in str(world.game.result())
    assert world.game.result().provenance["information"] == "full"


def test_a_fork_is_given_only_while_an_agent_decides(world):
    world.game.step()
    state = world.agent.get_agent("ann").state
    with pytest.raises(IllegalMutation, match=r"Between two turns use ctx.game.fork"):
        state["fork"](1)
    with pytest.raises(IllegalMutation, match="pickled"):
        pickle.loads(pickle.dumps(state["fork"]))(1)
    assert deepcopy(state["fork"]) == state["fork"]
    copy = deepcopy(world)
    copy.game.step()
    assert copy.forks[-1].game.turn == copy.game.turn - 1 == 1
