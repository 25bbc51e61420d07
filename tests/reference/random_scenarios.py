"""Random scenarios in the subset of the reference, and strategies that go by all that they know."""

from functools import cache
from pathlib import Path
from random import Random
from zlib import crc32

from gamms.scenario import Scenario

NUMBER_OF_MAPS = 12
TEAMS = ("red", "blue", "green")
SPEEDS = (None, None, 1, 2, 3, 4, 0.5, 1.5)
SPEEDS_IN_METRES = (None, 0.5, 1, 2, 2, 4)


@cache
def map_of(number):
    """Return a scenario that has the map alone."""
    given = {"generator": {"function": "maps:streets", "with": {"number": number}}}
    return Scenario(folder=Path(__file__).parent, max_turns=8, map=given, teams={"red": {"count": 1}})


def scenario_of(number):
    """Return a random scenario."""
    rng = Random(number)
    base = map_of(number % NUMBER_OF_MAPS)
    nodes = base.columns().node_ids.tolist()
    is_metric = rng.random() < 0.4
    speeds = SPEEDS_IN_METRES if is_metric else SPEEDS
    teams = {team: team_of(rng, team, nodes, speeds) for team in TEAMS[: rng.randint(2, 3)]}
    changes = {"teams": teams, "seed": number, "max_turns": rng.randint(4, 9)}
    changes["settings"] = {"on_illegal": "stay"} | ({"speed_unit": "metres"} if is_metric else {})
    if rng.random() < 0.3:
        changes["settings"]["order"] = order_of(rng, list(teams))
    changes["rules"] = rules_of(rng, list(teams), nodes, changes["settings"])
    if rng.random() < 0.5:
        changes["conflicts"] = conflicts_of(rng, list(teams), nodes)
    if rng.random() < 0.4:
        names = [agent["name"] for team in teams.values() for agent in team["agents"]]
        changes["channels"] = {name: channel_of(rng, list(teams), names, nodes) for name in ("radio", "shout")}
    return base.replace(**changes)


def team_of(rng, team, nodes, speeds):
    """Return a random team, whose agents have names that are in no order."""
    agents = []
    for i in range(rng.randint(1, 3)):
        agent = {"name": f"{rng.choice('abcxyz')}{i}{team}", "node": rng.choice(nodes)}
        speed = rng.choice(speeds)
        if speed is not None:
            agent["speed"] = speed
        agents.append(agent)
    return {"agents": agents}


def order_of(rng, teams):
    """Return a random order of play."""
    rng.shuffle(teams)
    cut = rng.randint(1, len(teams))
    return [part for part in (teams[:cut], teams[cut:]) if part]


def rules_of(rng, teams, nodes, settings):
    """Return random rules."""
    is_metric = "speed_unit" in settings
    rules = []
    land = {node: rng.choice(teams) for node in nodes if rng.random() < 0.8}
    territory = rng.choice([None, land, "territory"])
    if territory == "territory":
        rules.append({"rule": "gamms.rules.territory:published", "with": {"nodes": land}})
    if rng.random() < 0.7:
        tags = [tag_of(rng, teams, territory, is_metric) for _ in range(rng.randint(1, 2))]
        # Which of two rules with the same sides counts at one moment is open.
        sides = {(tag["taggers"], tag["tagged"]): tag for tag in tags}
        rules += [{"rule": "tag", "with": tag} for tag in sides.values()]
    if rng.random() < 0.6:
        rules.append({"rule": "capture_flag", "with": flags_of(rng, teams, nodes, territory)})
    if rng.random() < 0.3:
        team = rng.choice(teams)
        goals = rng.sample(nodes, 2)
        nodes_or_starts = rng.choice([goals, goals[0], f"starts of {rng.choice(teams)}"])
        rules.append(
            {"rule": "arrive", "with": {"team": team, "nodes": nodes_or_starts, "passing": rng.random() < 0.7}}
        )
    if rng.random() < 0.5:
        given = {"after": rng.randint(1, 3), "times": rng.choice([None, 1, 2])}
        rules.append({"rule": "respawn", "with": given})
    if rng.random() < 0.2:
        rules.append("last_team")
    if rng.random() < 0.2:
        rules.append({"rule": "none_left", "with": {"team": rng.choice(teams)}})
    if rng.random() < 0.3:
        rules.append({"rule": "time_limit", "with": {"turns": rng.randint(2, 8)}})
    return rules


def tag_of(rng, teams, territory, is_metric):
    """Return random keywords of a `tag` rule."""
    taggers, tagged = rng.sample(teams, 2)
    given = {"taggers": taggers, "tagged": tagged, "mutual": rng.random() < 0.4}
    distances = [{}, {}, {"hops": rng.choice([0, 1, 2])}, {"metres": 2.5}, {"euclid": 1.5}]
    given |= rng.choice(distances[:2] if is_metric else distances)
    given["then"] = rng.choice(["respawn", "eliminate"])
    given["score"] = rng.choice([0, 1, 2.5])
    if territory is not None and rng.random() < 0.5:
        given["territory"] = territory
    if not is_metric and rng.random() < 0.2:
        given["passing"] = False
    return given


def flags_of(rng, teams, nodes, territory):
    """Return random keywords of a `capture_flag` rule."""
    flags = {team: rng.choice(nodes) for team in rng.sample(teams, rng.randint(1, len(teams)))}
    given = {"flags": flags, "goal": rng.choice([None, 1, 2]), "passing": rng.random() < 0.8}
    if territory is not None and rng.random() < 0.6:
        given["territory"] = territory
    return given


def conflicts_of(rng, teams, nodes):
    """Return random keywords of conflicts."""
    by_node = {node: rng.choice([0, 1, 2]) for node in rng.sample(nodes, 4)}
    return {
        "capacity": rng.choice([1, 1, 2, None, by_node]),
        "among": rng.choice(["all", "all", "team"]),
        "allow_swaps": rng.random() < 0.6,
        "resolve": rng.choice(["at_random", "at_random", "nobody", {"by_priority": rng.sample(teams, len(teams))}]),
    }


def channel_of(rng, teams, names, nodes):
    """Return random keywords of a channel."""
    given = rng.choice([{"range_m": 2.5}, {"range_m": 9}, {"hops": 1}, {"hops": 3}, {"range_m": 4, "hops": 2}])
    given = dict(given)
    if rng.random() < 0.5:
        given["loss"] = rng.choice([0.3, 0.6, [[0, 0.1], [3, 0.9]]])
    if rng.random() < 0.4:
        given["relay"] = rng.choice([True, rng.sample(teams, 1), rng.sample(names, 2)])
    if rng.random() < 0.4:
        given["delay_turns"] = rng.randint(1, 3)
    if rng.random() < 0.3:
        given["teams"] = rng.sample(teams, rng.randint(1, len(teams)))
    if rng.random() < 0.3:
        given["eavesdroppers"] = rng.sample(names, 1)
    if rng.random() < 0.3:
        where = rng.choice([{"agent": rng.choice(names)}, {"team": rng.choice(teams)}, {"at": rng.choice(nodes)}])
        given["jammers"] = [{**where, "radius_m": rng.choice([0.5, 2])}]
    return given


def wander(state):
    """Do what follows from all that an agent knows: go near or far, along lists, wait, or try what is not legal."""
    legal = state["legal"]
    known = [state["name"], state["turn"], state["curr_pos"], legal, state["blocked"] is None, sorted(state["memory"])]
    known += [(state["edge"] or ())[:2], state["offset_m"]] if "edge" in state else []
    known += [plain(state["facts"]), state["draw"].below(1000), plain(state.get("inbox"))]
    lot = crc32(repr(known).encode())
    state["memory"][lot % 7] = None
    one = legal[lot // 8 % len(legal)]
    other = legal[lot // 64 % len(legal)]
    wanted = [
        one,
        one,
        one,
        other,
        [one],
        [one, state["curr_pos"]],
        [one, other],
        [one, one, other],
        [one, state["curr_pos"]],
    ]
    wanted += [{"node_id": one}, lot // 64 % 40, "nowhere", None if "edge" in state else one, state["curr_pos"]]
    state["action"] = wanted[lot // 512 % len(wanted)]
    if "outbox" in state:
        call(state, lot // 4096)


def call(state, lot):
    """Send what follows from a lot: to all, to a team, to an agent, or to nobody that there is."""
    for _ in range(lot % 3):
        to = [None, None, "red", "blue", "green", state["name"], *known_names(state)][
            lot // 8 % 8 % (6 + len(known_names(state)))
        ]
        state["outbox"].append(
            {"channel": ("radio", "shout", "none")[lot // 64 % 13 % 7 % 3], "to": to, "body": lot % 97}
        )
        lot = lot // 3 + 11


def known_names(state):
    """Return the names of those that an agent has heard."""
    return sorted({message["sender"] for message in state["inbox"]})


def plain(value):
    """Return mappings, however they are made, as lists that print alike."""
    if hasattr(value, "items"):
        return sorted((repr(key), plain(one)) for key, one in value.items())
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    return value
