"""The game of radio_search.py without GAMMS."""

from math import dist, hypot

import networkx as nx
from keyed import Draw, bits_of_pair, fraction

SIDE, HEIGHT, SPEED, PATIENCE, TURNS = 20, 30.0, 12.0, 12, 150
LANES = [(x, y) for i, y in enumerate((25, 75, 125, 175)) for x in ((0, 190) if i % 2 == 0 else (190, 0))]


def play(seed, nodes, edges, starts):
    """Yield after each turn: agent -> node of the living, scores, where the drone is, who heard what.

    Args:
        seed: of the game.
        nodes: node -> (x, y).
        edges: (source, target, length), in their order.
        starts: agent -> node, without the drone; robots and people by their names.
    """
    graph = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_weighted_edges_from(edges)
    hops = dict(nx.all_pairs_shortest_path_length(graph))
    legal = {node: [node, *graph[node]] for node in graph}
    at, place, lane, scores = dict(sorted(starts.items())), (0.0, 25.0, HEIGHT), 0, {}
    reports = {name: {} for name in at if name.startswith("robot")}
    inboxes = {name: [] for name in reports}
    for turn in range(TURNS):
        seen = {
            name: node
            for name, node in at.items()
            if name.startswith("lost") and dist((*nodes[node], 0.0), place) <= 55.0
        }
        if hypot(LANES[lane][0] - place[0], LANES[lane][1] - place[1]) < SPEED:
            lane = (lane + 1) % len(LANES)
        way = LANES[lane][0] - place[0], LANES[lane][1] - place[1]
        length = hypot(*way)
        place = place[0] + way[0] / length * SPEED, place[1] + way[1] / length * SPEED, HEIGHT
        before = dict(at)
        for name, here in before.items():
            if name in reports:
                at[name] = robot_step(here, turn, inboxes[name], reports[name], hops, legal)
            else:
                at[name] = Draw(seed, name, turn).choice(legal[here])
        messages, inboxes = [], {name: [] for name in reports}
        for k, (who, node) in enumerate(seen.items()):
            heard, lost = sent(seed, turn, k, place, {name: nodes[at[name]] for name in reports})
            messages.append((who, heard, lost))
            for name in heard:
                inboxes[name].append((who, turn, node))
        for _, person in tags(seed, turn + 1, before, at):
            del at[person]
            scores["robots"] = scores.get("robots", 0) + 1
        yield dict(at), dict(scores), place, messages
        if not any(name.startswith("lost") for name in at):
            return


def robot_step(here, turn, inbox, reports, hops, legal):
    """Return the next node of a robot."""
    for who, then, node in inbox:
        reports[who] = then, node
    fresh = [node for _, (then, node) in sorted(reports.items()) if turn - then <= PATIENCE and node != here]
    if not fresh:
        return here
    goal = min(fresh, key=hops[here].get)
    return goal if goal in legal[here] else min(legal[here], key=lambda node: (hops[node][goal], node))


def sent(seed, turn, k, place, robots):
    """Return which robots hear a message of the drone, and for which it is lost."""
    heard, lost = [], []
    for name, (x, y) in robots.items():
        away = dist((x, y, 0.0), place)
        if away <= 130.0:
            chance = 0.6 * max(0.0, (away - 40.0) / 90.0)
            is_lost = fraction(seed, ("channel", "radio", "drone"), name, turn, k) < chance
            (lost if is_lost else heard).append(name)
    return heard, lost


def tags(seed, turn, before, after):
    """Return robots and the people that they meet, each in one pair: first on edges, then on nodes, then by lot."""
    met = []
    for robot in (name for name in after if name.startswith("robot")):
        for person in (name for name in after if name.startswith("lost")):
            stays = before[robot] == after[robot] and before[person] == after[person]
            lot = bits_of_pair(seed, ("contacts",), robot, person, turn)
            if after[robot] == after[person]:
                met.append((0.0 if stays else 1.0, lot, robot, person))
            elif after[robot] == before[person] and after[person] == before[robot]:
                met.append((0.0, lot, robot, person))
    pairs, taken = [], set()
    for *_, robot, person in sorted(met):
        if not taken & {robot, person}:
            taken |= {robot, person}
            pairs.append((robot, person))
    return pairs
