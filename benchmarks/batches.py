"""Many games, one by one against bare Python, and at once against these and a NumPy kernel that only walks."""

import random

import numpy as np

WALK = "gamms.strategies:random_walk"
TEAMS = {"red": {"count": 5, "strategy": WALK}, "blue": {"count": 5, "strategy": WALK}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 8_000}, "goal": None}}
TAG = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}, {"rule": "time_limit", "with": {"turns": 200}}]


def of_helsinki(games=1024, *, is_fresh=False):
    """Games of 5 against 5 on Helsinki with tag and flags, 200 turns, against the same one by one.

    Args:
        games: in the batch.
        is_fresh: whether each of the others is `scenario.play(seed)`; else one context is `reset(seed)`.
    """
    from gamms.scenario import Scenario

    scenario = Scenario(map={"helsinki": {}}, teams=TEAMS, rules=[TAG[0], FLAGS, TAG[1]])
    batch, alone = scenario.batch(games), scenario.build(seed=0)

    def ours():
        batch.reset()
        while not batch.is_over.all():
            batch.step()
        return games * 10 * 200

    def floor(few=4):
        for seed in range(few):
            if is_fresh:
                scenario.play(seed=seed)
            else:
                alone.game.reset(seed=seed)
                alone.game.run()
        return few * 10 * 200

    return ours, floor


def of_many(games=32_768, few=4_096):
    """Games of 5 against 5 on Helsinki with tag, 200 turns, against fewer of them, which a cache holds."""
    from gamms.scenario import Scenario

    scenario = Scenario(map={"helsinki": {}}, teams=TEAMS, rules=TAG)

    def played(number):
        batch = scenario.batch(number)

        def run():
            batch.reset()
            batch.run()
            return number * 10 * 200

        return run

    return played(games), played(few)


def one_by_one(is_fresh, metres=5.0, turns=200):
    """Games of 5 against 5 with tag by distance and a time limit, against bare Python that builds the same states.

    Args:
        is_fresh: whether each game has a context of its own; else one context is reset.
        metres: within which agents are tagged.
        turns: of a game.
    """
    import gamms
    from gamms.rules import tag, time_limit

    def made():
        ctx = gamms.create_context(seed=1)
        gamms.osm.helsinki(ctx)
        starts = random.Random(3).sample(ctx.graph.columns().node_ids.tolist(), 10)
        for i, start in enumerate(starts):
            near = ctx.sensor.create_sensor(f"near_{i}", "neighbor")
            team = "red" if i < 5 else "blue"
            ctx.agent.create_agent(f"{team}_{i}", start_node_id=start, team=team, sensors=[near], strategy=walk)
        ctx.game.add(tag("red", "blue", euclid=metres))
        ctx.game.add(time_limit(turns))
        return ctx

    choice = random.Random(1).choice

    def walk(state):
        for _, ways in state["sensor"].values():
            state["action"] = choice(ways)

    kept = made()

    def ours():
        if is_fresh:
            with made() as ctx:
                ctx.game.run()
        else:
            kept.game.reset()
            kept.game.run()
        return 1

    begun = [agent.current_node_id for agent in kept.agent.create_iter()]
    return ours, bare_game(kept.graph.graph.neighborhoods, begun, walk, turns)


def of_scenario(is_fresh, turns=200):
    """The games of `of_helsinki` one by one, each with a seed of its own, against bare Python likewise.

    Args:
        is_fresh: whether each is `scenario.play(seed)`; else one context is `reset(seed)`.
        turns: of a game.
    """
    from gamms.scenario import Scenario

    scenario = Scenario(map={"helsinki": {}}, teams=TEAMS, rules=TAG)
    alone, seeds, choice = scenario.build(seed=0), iter(range(10**9)), random.Random(1).choice

    def ours():
        if is_fresh:
            scenario.play(seed=next(seeds))
        else:
            alone.game.reset(seed=next(seeds))
            alone.game.run()
        return 1

    def walk(state):
        state["action"] = choice(state["legal"])

    begun = [agent.current_node_id for agent in alone.agent.create_iter()]
    return ours, bare_game(alone.graph.graph.neighborhoods, begun, walk, turns)


def bare_game(near, begun, walk, turns):
    """Play a game by a loop that builds states of ten keys, and asks a strategy."""
    draw, rng, facts, memories = object(), object(), {}, [{} for _ in begun]
    names = [f"red_{i}" for i in range(len(begun))]

    def play():
        at, before = list(begun), list(begun)
        for turn in range(turns):
            for i, node in enumerate(at):
                ways = near[node]
                state = {
                    "curr_pos": node,
                    "sensor": {"near": (0, list(ways))},
                    "name": names[i],
                    "team": "red",
                    "turn": turn,
                    "legal": ways,
                    "draw": draw,
                    "rng": rng,
                    "memory": memories[i],
                    "facts": facts,
                }
                walk(state)
                before[i], at[i] = node, state["action"]
        return 1

    return play


def walks(agents=102_400, side=300, turns=10):
    """Agents that walk at random, ten in each game, against an int32 kernel of NumPy with keyed draws."""
    from gamms.scenario import Scenario

    scenario = Scenario(map={"grid": {"width": side, "height": side}}, teams=TEAMS, max_turns=10**9)
    batch = scenario.batch(agents // 10)
    offsets, targets, counts = neighbor_lists(side)
    place = np.random.default_rng(1).integers(side**2, size=agents).astype(np.int32)
    keys = np.random.default_rng(2).integers(2**63, size=agents).astype(np.uint64)

    def ours():
        for _ in range(turns):
            batch.step()
        return agents * turns

    def floor():
        node = place
        for turn in range(turns):
            bits = mixed(mixed(keys + np.uint64(turn)) + np.uint64(1))
            chosen = ((bits >> np.uint64(32)) * counts[node] >> np.uint64(32)).astype(np.int32)
            node = targets[offsets[node] + chosen]
        return agents * turns

    return ours, floor


def neighbor_lists(side):
    """Return offsets, targets and counts of a square grid, each node among its own neighbours."""
    rows = []
    for node in range(side * side):
        x, y = node % side, node // side
        near = [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
        rows.append([b * side + a for a, b in near if 0 <= a < side and 0 <= b < side])
    counts = np.array([len(row) for row in rows])
    offsets = np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.int32)
    return offsets, np.concatenate(rows).astype(np.int32), counts.astype(np.uint64)


def mixed(bits):
    """The finalizer of SplitMix64."""
    bits = (bits ^ bits >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ bits >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return bits ^ bits >> np.uint64(31)
