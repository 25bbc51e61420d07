"""Games of attacks, cooldowns and orders of play, against a simulation in plain Python that knows nothing of GAMMS."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms

SIDE, TURNS = 3, 6
NODES = range(SIDE * SIDE)
NEAR = {
    node: [node]
    + [node + step for step in (-1, 1) if 0 <= node % SIDE + step < SIDE]
    + [node + SIDE * step for step in (-1, 1) if 0 <= node // SIDE + step < SIDE]
    for node in NODES
}
COOLDOWN = 2  # turns after an attack in which there is none

agents = st.lists(st.tuples(st.sampled_from("xyz"), st.sampled_from(NODES)), min_size=2, max_size=6)
plans = st.lists(
    st.tuples(st.integers(0, 4), st.sampled_from(["", "attack", "attack", "shove"])), min_size=12, max_size=36
)
orders = st.sampled_from([None, [["x"], ["y"], ["z"]], [["z", "x"], ["y"]], [["y", "z"], ["x"]]])


def wanted(plan, number, turn, here, others):
    """Return the end and the deed (with its target) that an agent chooses, which sees where all are."""
    step, deed = plan[(7 * number + turn) % len(plan)]
    end = NEAR[here][step % len(NEAR[here])]
    targets = sorted(name for name, node in others.items() if node in NEAR[here])
    return end, (deed, targets[step % len(targets)]) if deed and targets else None


def simulated(crew, plan, order):
    """Play the game without GAMMS; return where all are, who lives, and what was done, turn by turn."""
    place, alive = {f"a{i}": node for i, (_, node) in enumerate(crew)}, {f"a{i}": True for i in range(len(crew))}
    team = {f"a{i}": side for i, (side, _) in enumerate(crew)}
    ready = dict.fromkeys(place, 0)
    log = []
    for turn in range(TURNS):
        did_attack = []
        for sides in order or [["x", "y", "z"]]:
            movers = [name for name in sorted(place) if alive[name] and team[name] in sides]
            chosen = {}
            for name in movers:
                others = {other: node for other, node in place.items() if other != name and alive[other]}
                chosen[name] = wanted(plan, int(name[1:]), turn, place[name], others)
            deeds = [(name, *deed) for name, (_, deed) in sorted(chosen.items()) if deed is not None]
            deeds = [one for one in deeds if one[1] != "attack" or ready[one[0]] <= turn]
            log += [(turn + 1, *one, place[one[0]]) for one in deeds]
            before = dict(place)
            for name, kind, target in deeds:
                if kind == "attack":
                    alive[target] = False
                    did_attack.append(name)
                else:
                    place[target] = 0
            for name in movers:
                if alive[name] and place[name] == before[name]:
                    place[name] = chosen[name][0]
        for name in did_attack:
            ready[name] = turn + 1 + COOLDOWN
    return place, alive, log


def played(crew, plan, order, names):
    """Play it by GAMMS, with the agents created in this order."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game={"order": order}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(SIDE, SIDE))
        ctx.game.deeds = {"attack": {"target": "agent"}, "shove": {"target": "agent"}}

        def strategy(state):
            places = {agent.name: agent.current_node_id for agent in ctx.game.agents if agent.name != state["name"]}
            end, deed = wanted(plan, int(state["name"][1:]), state["turn"], state["curr_pos"], places)
            state["action"] = {"node_id": end, "do": dict([deed] if deed else [])}

        for name in names:
            side, node = crew[int(name[1:])]
            ctx.agent.create_agent(name, start_node_id=node, team=side, strategy=strategy)

        def cool(ctx):
            """Note who has attacked; its check refuses attacks that come too early."""
            ready = ctx.game.data.setdefault("ready", {})
            ready.update({deed.agent: ctx.game.turn + COOLDOWN for deed in ctx.game.performed("attack")})

        def check(ctx):
            for deed in ctx.game.performed("attack"):
                if ctx.game.data.get("ready", {}).get(deed.agent, 0) > ctx.game.turn:
                    ctx.game.refuse(deed.agent, "it is not ready", deed="attack")

        cool.check = check

        @ctx.game.add(phase="deeds")
        def act(ctx):
            for deed in ctx.game.performed():
                if deed.kind == "attack":
                    ctx.game.eliminate(deed.values["target"])
                else:
                    ctx.agent.get_agent(deed.values["target"]).current_node_id = 0

        ctx.game.add(cool)
        result = ctx.game.run(TURNS)
        place = {name: one["node"] for name, one in result.agents.items()}
        alive = {name: one["alive"] for name, one in result.agents.items()}
        log = [(one["turn"], one["agent"], one["deed"], one["target"], one["at"]) for one in result.deeds]
    return place, alive, log


@settings(max_examples=12, suppress_health_check=list(HealthCheck))
@given(crew=agents, plan=plans, order=orders, turned=st.booleans())
def test_a_game_of_deeds_is_what_a_simulation_by_hand_says(crew, plan, order, turned):
    names = [f"a{i}" for i in range(len(crew))]
    assert played(crew, plan, order, names[::-1] if turned else names) == simulated(crew, plan, order)
