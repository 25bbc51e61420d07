"""A reading of turn restrictions of its own, from the text of a map: it shares no code with the library.

A drive is a list of node ids of the map. `Referee.forbidden_turns` returns the restrictions that it violates.
"""

import gzip
import math
import random
import xml.etree.ElementTree as ET
from collections import defaultdict
from itertools import pairwise

CARS = ("motorcar", "motor_vehicle", "vehicle")
STREETS = {"primary", "secondary", "tertiary", "unclassified", "residential", "living_street"}
SIGNS = ["no_left_turn", "no_right_turn", "no_straight_on", "no_u_turn", "no_entry", "only_straight_on"]


class Referee:
    """The turn restrictions of a map for cars."""

    def __init__(self, path):
        root = ET.parse(path).getroot()
        self.places = {int(n.get("id")): (float(n.get("lat")), float(n.get("lon"))) for n in root.iter("node")}
        self.lines = {int(w.get("id")): [int(nd.get("ref")) for nd in w.iter("nd")] for w in root.iter("way")}
        self.rules = [rule for one in root.iter("relation") if (rule := self._rule(one))]
        self.at = {place: id for id, place in self.places.items()}

    def _rule(self, relation):
        tags = {tag.get("k"): tag.get("v") for tag in relation.iter("tag")}
        if tags.get("type") != "restriction":
            return None
        sign = next(
            (tags[f"restriction:{car}"] for car in CARS if f"restriction:{car}" in tags), tags.get("restriction")
        )
        if sign is None or set(tags.get("except", "").split(";")) & set(CARS):
            return None
        members = defaultdict(list)
        for one in relation.iter("member"):
            members[one.get("role")].append((one.get("type"), int(one.get("ref"))))
        return sign, members

    def _touching(self, way, node):
        """Return the neighbors of a node along a way."""
        line = self.lines.get(way, [])
        return {b for a, b in [*pairwise(line), *pairwise(line[::-1])] if a == node}

    def sequences(self, rule):
        """Return the node sequences that a rule is about."""
        sign, members = rule
        found = set()
        for _, start in members["from"]:
            for _, end in members["to"]:
                for via in self._vias(members["via"], start):
                    if len(via) == 1:
                        for x in self._touching(start, via[0]):
                            for y in self._touching(end, via[0]):
                                is_turn_back = x == y
                                if sign.endswith("u_turn") and start == end:
                                    found |= {(x, *via, y)} if is_turn_back else set()
                                elif not is_turn_back:
                                    found.add((x, *via, y))
                    else:
                        found |= {
                            (x, *via, y) for x in self._touching(start, via[0]) for y in self._touching(end, via[-1])
                        }
        return found

    def _vias(self, members, start):
        if members[0][0] == "node":
            return [(members[0][1],)]
        ways = [way for _, way in members]
        found = []

        def walk(path, left):
            if not left:
                found.append(tuple(path))
            for way in left:
                line = self.lines.get(way, [])
                for one in (line, line[::-1]):
                    if path[-1] in one[:-1]:
                        rest = one[one.index(path[-1]) + 1 :]
                        for stop in range(1, len(rest) + 1):
                            walk([*path, *rest[:stop]], [other for other in left if other != way])

        for begin in set(self.lines.get(start, [])):
            walk([begin], ways)
        return found

    def judge(self, pieces):
        """Prepare to judge drives on these directed pieces of road, (node, node)."""
        self.no = defaultdict(set)
        self.only = defaultdict(set)
        for rule in self.rules:
            for one in self.sequences(rule):
                if not rule[0].startswith("only"):
                    self.no[one[:2]].add(one)
                elif all(piece in pieces for piece in pairwise(one)):
                    for end in range(2, len(one)):
                        self.only[one[:end]].add(one[end])
        self.pieces = pieces

    def forbidden_turns(self, drive):
        """Return the forbidden turns of a drive."""
        wrong = []
        for i in range(len(drive) - 2):
            wrong += [one for one in self.no.get(tuple(drive[i : i + 2]), ()) if tuple(drive[i : i + len(one)]) == one]
            for end in range(i + 2, len(drive)):
                begin = tuple(drive[i:end])
                if begin in self.only and drive[end] not in self.only[begin] and drive[end] != drive[end - 2]:
                    wrong.append((*begin, drive[end]))
                if begin not in self.only:
                    break
        return wrong

    def nodes_along(self, lat, lon):
        """Return the nodes of the map at these places in degrees, in order; places without a node are left out."""
        if not hasattr(self, "cells"):
            self.cells = {(round(a * 1e6), round(b * 1e6)): id for id, (a, b) in self.places.items()}
        found = []
        for a, b in zip(lat, lon, strict=True):
            row, column = round(a * 1e6), round(b * 1e6)
            around = (self.cells.get((row + i, column + j)) for i in (0, -1, 1) for j in (0, -1, 1))
            near = next((id for id in around if id is not None and math.dist(self.places[id], (a, b)) < 2e-7), None)
            if near is not None and near not in found[-1:]:
                found.append(near)
        return found


def add_signs(path, target, seed, count):
    """Write a map with random turn restrictions between its streets for cars, and return its path."""
    draw = random.Random(seed)
    with gzip.open(path) as stream:
        root = ET.parse(stream).getroot()
    lines = {}
    at = defaultdict(list)
    for way in root.iter("way"):
        if any(tag.get("v") in STREETS for tag in way.iter("tag") if tag.get("k") == "highway"):
            lines[way.get("id")] = [nd.get("ref") for nd in way.iter("nd")]
            for ref in lines[way.get("id")]:
                at[ref].append(way.get("id"))
    junctions = [ref for ref, ways in at.items() if len(ways) > 1]
    for number in range(count):
        relation = ET.SubElement(root, "relation", id=str(number + 1))
        begin = draw.choice(junctions)
        via = draw.choice(at[begin])
        ends = [ref for ref in lines[via] if ref != begin and len(at[ref]) > 1]
        starts = [way for way in at[begin] if way != via]
        members = [("way", way, "from") for way in starts[:2]]
        if ends and draw.random() < 0.5:
            end = draw.choice(ends)
            members += [("way", via, "via"), ("way", next(way for way in at[end] if way != via), "to")]
        else:
            members += [("node", begin, "via"), ("way", draw.choice(at[begin]), "to")]
        for kind, ref, role in members:
            ET.SubElement(relation, "member", type=kind, ref=ref, role=role)
        ET.SubElement(relation, "tag", k="type", v="restriction")
        ET.SubElement(relation, "tag", k="restriction", v=draw.choice(SIGNS))
    ET.ElementTree(root).write(target)
    return target
