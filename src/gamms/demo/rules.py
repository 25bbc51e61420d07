"""The rules of capture the flag: who is tagged, who takes a flag, who scores. A rule is a function of the match."""

from math import hypot
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gamms.agent import Member
    from gamms.demo.match import Match

TAG_M = 8.0  # an intruder this close to a defender is tagged


def tag_rule(match: "Match") -> None:
    """Send home every agent that a member of the other team meets in that team's territory."""
    graph = match.ctx.graph.graph
    places = {agent.name: graph.get_node(agent.current_node_id) for agent in match.agents}
    for intruder in match.agents:
        defenders = [one for one in match.agents if one.team != intruder.team]
        here = places[intruder.name]
        if match.world.side[here.id] == intruder.team:
            continue
        by = [
            one
            for one in defenders
            if match.world.side[places[one.name].id] == one.team
            and hypot(places[one.name].x - here.x, places[one.name].y - here.y) <= TAG_M
        ]
        if by:
            _send_home(match, intruder, by[0])


def flag_rule(match: "Match") -> None:
    """Let agents take the flag they stand on, and score with the one they brought home."""
    for agent in match.agents:
        enemy, node = 1 - agent.team, agent.current_node_id
        carrier = match.announced.carriers.get(enemy)
        if carrier is None and node == match.world.flag[enemy]:
            match.announced.carriers[enemy] = agent.name
            match.note("take", agent)
        elif carrier == agent.name and match.world.side[node] == agent.team:
            del match.announced.carriers[enemy]
            match.scores[agent.team] += 1
            match.note("capture", agent)


def end_rule(match: "Match") -> None:
    """End the game when a team has enough captures, or time is up."""
    if max(match.scores) >= match.goal:
        match.end(f"{match.goal} captures")
    elif match.turn >= match.max_turns:
        match.end("time is up")


def _send_home(match: "Match", intruder: "Member", by: "Member") -> None:
    intruder.prev_node_id = intruder.current_node_id = match.start_of[intruder.name]
    match.note("tag", by, intruder)
    if match.announced.carriers.get(by.team) == intruder.name:
        del match.announced.carriers[by.team]
        match.note("save", by, intruder)


RULES = (tag_rule, flag_rule, end_rule)
