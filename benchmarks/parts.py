"""Parts of games in batches of 1,024, each against the same games one after the other by `reset` and `run`."""

import numpy as np

import gamms

ROADS = 1520  # edges of the grid of 20 x 20
WALK = {"count": 5, "strategy": "gamms.strategies:random_walk"}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
DEEDS = {"scan": {"node": "node"}, "mark": {"size": "number"}}
PRICED = [
    {
        "rule": "resource",
        "with": {"name": "fuel", "start": 9, "per_deed": {"scan": 1, "mark": 0.5}, "recharge": {0: 3}},
    },
    {"rule": "cooldown", "with": {"deed": "scan", "turns": 2}},
]


def act(view):
    """Walk at random, and do two things now and then."""
    actions = view.draw.below(view.counts)
    view.do("scan", view.draw.random() < 0.3, node=view.streets.step(view.node, actions))
    view.do("mark", view.draw.random() < 0.2, size=view.draw.random())
    return actions


def act_alone(state):
    """Do the same as an agent alone."""
    legal, draw, done = state["legal"], state["draw"], {}
    node = legal[draw.below(len(legal))]
    if draw.random() < 0.3:
        done["scan"] = {"node": node}
    if draw.random() < 0.2:
        done["mark"] = {"size": draw.random()}
    state["action"] = {"node_id": node, "do": done} if done else node


def talk(view):
    """Walk at random, and call all now and then."""
    view.heard("radio")
    view.send("radio", view.draw.random() < 0.2, view["curr_pos"])
    return view.draw.below(view.counts)


def talk_alone(state):
    """Do the same as an agent alone."""
    if state["draw"].random() < 0.2:
        state["outbox"].append({"channel": "radio", "to": None, "body": state["curr_pos"]})
    state["action"] = state["legal"][state["draw"].below(len(state["legal"]))]


def batch_of(rules, settings, strategies=None, plain=None, games=1024, turns=50, **more):
    """Games of 5 against 5 on a grid of 20 x 20 in a batch, and the same one by one, perhaps by plain strategies."""
    from gamms.scenario import Scenario

    given = {"map": {"grid": {"rows": 20, "columns": 20}}, "teams": {"red": WALK, "blue": WALK}, **more}
    agents = sum(team["count"] for team in given["teams"].values())
    scenario = Scenario(rules=rules, settings=settings, max_turns=turns, **given)
    batch, alone = scenario.batch(games, strategies=strategies), scenario.build(seed=0, strategies=plain or strategies)
    if not batch.is_in_arrays:
        raise RuntimeError(f"Games of this batch are played one by one: {batch.detached}.")

    def ours():
        batch.reset()
        while not batch.is_over.all():
            batch.step()
        return games * agents * turns

    def floor(few=4):
        for seed in range(few):
            alone.game.reset(seed=seed)
            alone.game.run()
        return few * agents * turns

    return ours, floor


def in_order():
    """Teams that move one after the other and tag."""
    return batch_of([TAG], {"order": [["red"], ["blue"]]})


def by_edges():
    """Agents that go two edges a turn at random, and tag."""
    return batch_of([TAG], {}, teams={key: {**WALK, "speed": 2} for key in ("red", "blue")})


def by_metres():
    """Agents that travel by metres to places drawn at random, and tag where they meet on edges."""
    goes = {**WALK, "strategy": "gamms.strategies:random_waypoints", "speed": 7.0}
    return batch_of([TAG], {"speed_unit": "metres"}, teams={"red": goes, "blue": goes})


def with_deeds():
    """Agents that do two kinds of deeds, with a price and a cooldown."""
    acts = gamms.array_strategy(act)
    return batch_of(PRICED, {"deeds": DEEDS}, {"red": acts, "blue": acts}, {"red": act_alone, "blue": act_alone})


@gamms.array_rule
def close_roads(turn):
    """Close another road in each game in every fifth turn."""
    for place in np.flatnonzero(turn.turn % 5 == 0):
        turn.close_roads([place], [(7 * int(turn.seeds[place]) + int(turn.turn[place])) % ROADS])


def with_closed_roads():
    """Agents that walk at random and tag, in games with other roads closed in each."""
    return batch_of([TAG, {"rule": "parts:close_roads"}], {}, games=256, allow=["parts"])


def with_plain_rule():
    """Agents that walk at random and tag, and a rule without an array form that looks at all of them."""
    return batch_of([TAG, {"rule": "parts:count_the_living"}], {}, games=256, allow=["parts"])


def count_the_living(ctx):
    """Give red as many points as agents are alive, now and then."""
    if sum(agent.alive for agent in ctx.agent.create_iter()) % 7 == 0:
        ctx.game.scores["red"] += 1.0


def with_a_drone():
    """Agents that walk at random and tag below a drone that flies at random."""
    drone = {**WALK, "count": 1, "type": "aerial", "altitude": 20.0, "speed": 15.0}
    return batch_of([TAG], {}, games=256, teams={"red": WALK, "blue": WALK, "air": drone})


def with_close_tags():
    """Agents that travel by metres and tag from afar."""
    goes = {**WALK, "strategy": "gamms.strategies:random_waypoints", "speed": 7.0}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "euclid": 8.0}}
    return batch_of([tag], {"speed_unit": "metres"}, games=256, teams={"red": goes, "blue": goes})


def with_messages():
    """Agents that call all others now and then, of which some do not hear it."""
    talks = gamms.array_strategy(talk)
    radio = {"radio": {"range_m": 60.0, "loss": 0.2}}
    alone = {"red": talk_alone, "blue": talk_alone}
    return batch_of([], {}, {"red": talks, "blue": talks}, alone, channels=radio)
