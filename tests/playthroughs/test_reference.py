"""The reference plays games of the gallery as the golden texts of the library say.

It has its own turn, moves, rules and sensors. Maps, starts and strategies are those of the library.
"""

import os

import pytest
from gallery_turns import GAMES, GOLDEN
from plain_game.simulator import Game

from gamms import scenario
from gamms.sensor import SensorType
from gamms.testing.playthroughs import Outcome, Transcript
from gamms.typing import State

LEFT_OUT = {"fog", "marks"}  # rules that change nothing, and are drawn


class ToldGame(Game):
    """A game of the reference whose turns are written."""

    transcript = None  # while no turn is written
    library = None  # the context in which the strategies of the library look up other agents

    def step(self):
        """Play one turn; strategies find the agents where the reference has them."""
        for agent in self.agents.values():
            known = self.library.agent.get_agent(agent.name)
            if known.current_node_id != agent.node:
                known.current_node_id = agent.node
            if known.alive and not agent.alive:
                self.library.game.eliminate(agent.name)
        super().step()

    def state_of(self, agent):
        """Return what an agent knows when it decides, and write it."""
        state = super().state_of(agent)
        state["sensor"] = {name: (SensorType[kind.upper()], seen) for name, (kind, seen) in state["sensor"].items()}
        if self.transcript is not None:
            self.transcript.add_state(state)
        return state

    def outcome(self, movers=(), events=()):
        """Return what the last turn has led to."""
        is_metric = self.motion.is_metric
        places = {}
        for agent in self.living():
            places[agent.name] = {"curr_pos": agent.node}
            if is_metric and agent.target is not None:
                places[agent.name] |= {"edge": (agent.node, agent.target), "offset_m": float(agent.offset)}
        return Outcome(
            places=places,
            teams={name: self.agents[name].team for name in places},
            paths={name: self.agents[name].path for name in movers},
            messages=(),
            deeds=(),
            events=events,
            scores=dict(self.scores),
            facts=dict(self.facts),
            over=self.over,
        )

    def write(self, title, turns, names):
        """Play turns, and return their text."""
        self.transcript = Transcript(title, self.outcome(), frozenset(names))
        for _ in range(turns):
            known = len(self.events)
            movers = [agent.name for agent in self.living()]
            self.step()
            self.transcript.end_turn(self.turn, self.outcome(movers, self.events[known:]))
        text = self.transcript.write()
        self.transcript = None
        return text


def asked(strategy):
    """Return a strategy of the library as a function of a plain dict."""

    def decide(state):
        own = State(state)
        strategy(own)
        state.update(own)

    return decide


def asked_plan(plan):
    """Return a plan of the library as a function of plain dicts."""

    def decide(states):
        own = {name: State(state) for name, state in states.items()}
        plan(own)
        for name, state in states.items():
            state.update(own[name])

    return decide


def as_nodes(value, game):
    """Return a value of a scenario with the nodes that it describes by coordinates."""
    if isinstance(value, dict) and set(value) == {"node_at"}:
        return game.node_at(value["node_at"])
    if isinstance(value, dict):
        return {key: as_nodes(one, game) for key, one in value.items()}
    return [as_nodes(one, game) for one in value] if isinstance(value, list) else value


def make_game(name):
    """Return a game of the gallery for the reference, and the context that has its strategies."""
    game = scenario.from_gallery(name)
    ctx = game.build()
    for function in [agent.strategy for agent in ctx.agent.create_iter()]:
        getattr(function, "prepare", lambda _: None)(ctx)
    given = game.to_dict()
    rules = [one for one in given["rules"] if str(one).rpartition(":")[2] not in LEFT_OUT]
    for rule in rules:
        if isinstance(rule, dict) and rule["rule"].endswith(":published"):
            rule["with"]["nodes"] = dict(ctx.game.facts["territory"])
    changes = {"rules": as_nodes(rules, game)} | ({"facts": as_nodes(given["facts"], game)} if "facts" in given else {})
    strategies = {agent.name: asked(agent.strategy) for agent in ctx.agent.create_iter() if agent.strategy}
    plans = {team: asked_plan(plan.function) for team, plan in ctx.game.plans.items()}
    played = ToldGame(game.replace(**changes), strategies=strategies, plans=plans)
    played.library = ctx
    return played, ctx


def check_text(name):
    """Compare the text that the reference writes with the golden one."""
    turns = GAMES[name]
    text = (GOLDEN / f"{name}.txt").read_text(encoding="utf-8")
    lines = text.splitlines()
    titles = [lines[i : i + 2] for i, line in enumerate(lines) if ", after turn " in line]  # the library's description
    game, ctx = make_game(name)
    with ctx:
        first = game.write(titles[0], turns.first, turns.names)
        while game.turn < turns.later:
            game.step()
        assert f"{first}\n{game.write(titles[1], turns.more, turns.names)}" == text


@pytest.mark.parametrize(
    "name",
    ["capture_the_flag", "convoy", "cops_and_robber", "grid_tag", "helsinki_pursuit", "people_and_machines", "pursuit"],
)
def test_the_reference_writes_the_text_of_a_game(name):
    check_text(name)


@pytest.mark.skipif(os.environ.get("GAMMS_ALL_PLAYS") != "1", reason="takes half a minute")
def test_the_reference_writes_the_text_of_a_game_with_speeds_on_a_large_map():
    check_text("interception")
