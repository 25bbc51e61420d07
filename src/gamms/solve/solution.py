"""Solutions: the values of a game and optimal strategies, as a table over all states that its rules can reach."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from logging import getLogger
from typing import Any, Literal, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_float, as_function_of, as_int, as_known, as_mapping
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.graph import FloatArray, as_node_id
from gamms.scenario import Scenario
from gamms.solve.information import find_sensor_information
from gamms.solve.stages import BestResponseValues, Bound, Rewards, ValueIteration
from gamms.solve.table import Outcomes, StateGroup, Table, Transition, explore
from gamms.solve.worlds import GameSetup
from gamms.text import shown
from gamms.typing.game import State, Strategy

Reward = Literal["score", "win", "turns"] | Callable[[Transition], float]
"""The reward of a team, which the other one pays.

"score": the change of its score less that of the other team's; "win": 1 if it wins, -1 if the other one wins;
"turns": -1 for each turn, so that the team wants a short game; or a function of a `Transition`.
"""
REWARDS = ("score", "win", "turns")
MAX_STATES = 200_000
_MEMORY = "gamms.solve"  # the key of the memory of agents


class Choice(NamedTuple):
    """A joint action of a team, and its probability.

    Attributes:
        share: the probability, from 0 to 1.
        nodes: living agent -> the node that it goes to.
    """

    share: float
    nodes: Mapping[str, int]


class TableStrategy(ABC):
    """The strategy of a team in the states of a table: `scenario.play(strategies={"red": strategy})`.

    It reads the positions of all agents from the context, whatever their sensors show. All agents of the team draw the
    same joint action.

    Args:
        table: the states.
        side: the number of the team, 0 or 1.

    Attributes:
        team: the name of the team.
    """

    def __init__(self, table: Table, side: int) -> None:
        self._table = table
        self._side = side
        self.team = table.setup.teams[side]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({shown(self.team)})"

    def __call__(self, ctx: Context) -> Strategy:
        """Return the strategy of an agent in a game."""

        def strategy(state: State) -> None:
            if state["team"] != self.team:
                raise BadValue(f"{self!r} is for agents of team {shown(self.team)}, not for {shown(state['name'])}.")
            nodes, moved = self._read_places(ctx)
            state["action"] = self._choose_node(ctx, state, nodes, moved)

        return strategy

    def _choose_node(self, ctx: Context, state: State, nodes: list[int], moved: Mapping[str, int]) -> int:
        """Return the node to which an agent goes.

        Args:
            ctx: the context of the game.
            state: the state of the agent.
            nodes: the nodes of all agents before the turn, -1: out.
            moved: agents that have moved already in this turn -> their nodes.
        """
        memory = state["memory"]
        number = self._find_state(nodes, state["turn"], memory.get(_MEMORY))
        memory[_MEMORY] = number
        action = self._find_joint_action(ctx, state, number, self._find_seen_action(number, nodes, moved))
        return self._table.name_actions(number, self._side, action, nodes)[state["name"]]

    @abstractmethod
    def _find_joint_action(self, ctx: Context, state: State, number: int, seen: int | None) -> int:
        """Return the joint action of the team.

        Args:
            ctx: the context of the game.
            state: the state of an agent.
            number: the number of the state in the table.
            seen: the joint action of the other team, if it has moved already in this turn.
        """

    def _draw_number(self, ctx: Context, purpose: str, turn: int) -> float:
        """Return a number in [0, 1) that all agents of the team draw in a turn, from the seed of the game."""
        with get_phase(ctx).suspend(changes_world=False):  # strategies otherwise may not read the seed
            key = kernels.compute_purpose_key(ctx.seed, purpose)
        return kernels.convert_to_fraction(kernels.draw_bits(key, self._side, turn))

    def _find_seen_action(self, number: int, nodes: list[int], moved: Mapping[str, int]) -> int | None:
        """Return the joint action of the other team from its agents' nodes before the turn and moves in it."""
        table = self._table
        other = 1 - self._side
        for action in range(int(table.sizes[number, other]) if moved and len(table.setup.teams) == 2 else 0):
            wanted = table.name_actions(number, other, action, nodes)
            if all(moved.get(name, node) == node for name, node in wanted.items()):
                return action
        return None  # the other team does not move first, or a conflict has stopped it

    def _read_places(self, ctx: Context) -> tuple[list[int], dict[str, int]]:
        """Return the nodes of all agents before the turn, -1: out, and the nodes of those that have moved in it."""
        agents = ctx.agent.agents
        names = self._table.roster.names
        living = [agents[name] if name in agents and agents[name].alive else None for name in names]
        moved = self._list_moved_before(ctx)
        moves = ctx.game.moves if moved else {}
        started = {name: moves[name].start for name in moved}
        nodes = [-1 if one is None else started.get(one.name, one.current_node_id) for one in living]
        return nodes, {name: agents[name].current_node_id for name in moved}

    def _list_moved_before(self, ctx: Context) -> list[str]:
        """Return the living agents that move before this team in a turn."""
        agents = ctx.agent.agents
        names = self._table.earlier[self._side]
        return [name for name in names if name in agents and agents[name].alive]

    def _find_state(self, nodes: list[int], turn: int, before: int | None) -> int:
        """Return the state with agents on these nodes, -1: out; of several, one that can follow the state `before`."""
        table = self._table
        found = table.find_states(nodes, turn)
        if len(found) > 1 and before is not None:
            later = table.usual.after[table.offsets[before] : table.offsets[before + 1]]
            found = [number for number in found if number in later] or found
        if not found:
            raise BadValue(
                f"In turn {turn} agents are at positions that the solved game never reaches: "
                f"{table.name_nodes(nodes)}. It "
                f"was solved from the start of seed={table.setup.seed}, with the rules and strategies given to solve."
            )
        return found[0]


class SolvedStrategy(TableStrategy):
    """The strategy of a team in a solved game; made by `Solution.strategy`.

    Args:
        stages: the values of the game.
        side: the number of the team, 0 or 1.
    """

    def __init__(self, stages: ValueIteration, side: int) -> None:
        super().__init__(stages.table, side)
        self._stages = stages

    def _find_joint_action(self, ctx: Context, state: State, number: int, seen: int | None) -> int:
        turn = state["turn"]
        choice = self._find_action_probabilities(turn, number, seen)
        drawn = self._draw_number(ctx, _MEMORY, turn)
        action = int(np.searchsorted(np.cumsum(choice), drawn * choice.sum(), side="right"))
        return min(action, int(np.flatnonzero(choice)[-1]))

    def _find_action_probabilities(self, turn: int, number: int, seen: int | None) -> FloatArray:
        """Return the probabilities of the team's joint actions in a state; `seen` is the other team's action."""
        shares = find_action_shares(self._stages, number, self._stages.count_turns_left(turn, self._side), self._side)
        return shares[:, 0 if seen is None else seen]

    def is_of(self, scenario: Scenario, last_turn: int | None) -> bool:
        """Return whether it is from a solution of this scenario with this limit on turns; None: no limit."""
        setup = self._stages.table.setup
        return len(setup.teams) == 2 and (setup.scenario, setup.last_turn) == (scenario, last_turn)

    def best_response_of_other(self, reward: Reward, of: str) -> "TableSolution":
        """Return the best response of the other team, in the game that this strategy is from.

        Args:
            reward: the reward of team `of`.
            of: the team that gets the reward; the other one pays.

        Raises:
            BadValue: the strategy counts down turns in a game without a last turn, the game was solved without
                winners, or agents that a function as the reward tells apart were sorted.
        """
        stages = self._make_stages(reward)
        side = 1 - self._side
        table = stages.table
        if stages.is_counting_down(self._side):
            raise BadValue(
                f"{self!r} counts down the turns of a game without a last turn. Solve it with turns= or "
                "discount=, so that a best response exists."
            )
        if is_using_winner(reward) and not table.by_winner:
            raise BadValue(
                f"{self!r} is from a game that was solved without regard to the winner: solve it with reward='win'."
            )
        rewards = find_rewards(table, reward, stages.rewards.discount, of)
        answers = BestResponseValues(table, rewards, stages.tolerance, stages, side)
        return TableSolution(table, answers, table.setup.teams[side], reward)

    def _make_stages(self, reward: Reward) -> ValueIteration:
        """Return the values on a table that has what a reward reads."""
        table = self._stages.table
        if not callable(reward) or not table.is_merged:
            return self._stages
        if table.sorted_agents is not None:
            raise BadValue(
                f"{self!r} is from a game that was solved with interchangeable agents sorted, and a function as the "
                "reward may tell them apart: solve the game with a function as its reward, too."
            )
        return self._stages.move_to(explore(table.setup, by_winner=table.by_winner))


def find_action_shares(stages: ValueIteration, number: int, left: int, side: int) -> FloatArray:
    """Return the probabilities of a team's joint actions in a state, (actions, actions of the other team)."""
    table = stages.table
    rows, columns = table.sizes[number].tolist()
    grid = table.offsets[number] + np.arange(rows * columns).reshape(1, rows, columns)
    play = stages.play(StateGroup(np.array([number]), grid), left)
    shares: FloatArray = play.first[0] if side == 0 else play.second[0].T
    return shares


class Solution(ABC):
    """The values of a game of two teams under exact play, and optimal strategies; made by `solve` and `pursuit`.

    Attributes:
        teams: the teams that decide.
        team: the team whose values these are; the other one gets the negated values.
        value: the value of the start.
        information: "full": each team knows all positions, and its agents decide together.
        error: the largest numerical error of `value`, compared with the game under full information; inf: unknown, as
            in games without a last turn.
    """

    information = "full"
    teams: tuple[str, ...]
    team: str
    value: float
    error: float

    @property
    @abstractmethod
    def table(self) -> Table:
        """The states and transitions of the game."""

    @property
    @abstractmethod
    def sees(self) -> Mapping[str, str]:
        """How completely the sensors of each deciding team show the agents, in all states.

        "full": each agent can tell all positions; "team": only its agents together can; "agent": not even together.
        """

    @property
    @abstractmethod
    def bound(self) -> Bound:
        """How `value` bounds the value of the game in which agents know only their observations.

        "exact": equal; "upper": an upper bound, because the team itself does not see everything; "lower": a lower
        bound, because the other team does not; "none": neither is certain.
        """

    @property
    def is_exact(self) -> bool:
        """Whether `value` is the value of the game, up to `error`."""
        return self.bound == "exact"

    @abstractmethod
    def value_at(self, places: Mapping[str, int | None], turn: int = 0) -> float:
        """Return the value of a state for the team.

        Args:
            places: agent -> its node, None: it is out. Missing agents are at their starting nodes.
            turn: the number of turns played.

        Raises:
            UnknownName (KeyError): an agent does not exist.
            BadValue: the game does not reach the state, or not so early that its remaining turns were computed; or
                rules remember more than positions.
        """

    @abstractmethod
    def values(self, agent: str, places: Mapping[str, int | None] | None = None, turn: int = 0) -> dict[int, float]:
        """Return the values by the position of an agent: node -> value, for all nodes that `value_at` supports.

        Args:
            agent: the agent that is put on each node.
            places: see `value_at`.
            turn: the number of turns played.

        Raises:
            UnknownName, BadValue: see `value_at`.
        """

    @abstractmethod
    def policy(self, team: str, places: Mapping[str, int | None] | None = None, turn: int = 0) -> list[Choice]:
        """Return the joint actions of a team in a state with their probabilities, the largest first.

        If a team moves second, this is its response to the other team's best joint action.

        Args:
            team: one of the two teams.
            places: see `value_at`.
            turn: the number of turns played.

        Raises:
            UnknownName, BadValue: see `value_at`.
        """

    @abstractmethod
    def strategy(self, team: str | None = None) -> Callable[[Context], Strategy]:
        """Return the strategy of a team, for `scenario.play(strategies={team: …})`.

        Args:
            team: one of the two teams; None: the team whose values these are.

        Raises:
            UnknownName (KeyError): the game was not solved for this team.
        """

    @abstractmethod
    def nash_conv(self, strategies: Mapping[str, Any] | None = None) -> float:
        """Return the gain of both teams together from best responses, as in OpenSpiel; 0 in equilibrium.

        Args:
            strategies: strategies of one or both teams, from solutions of the same scenario; others default to those of
                this solution. For any other strategies see `gamms.solve.nash_conv`.

        Raises:
            BadValue: a strategy counts down turns in a game without a last turn.
        """

    def exploitability(self, strategies: Mapping[str, Any] | None = None) -> float:
        """Return `nash_conv` divided by the number of teams."""
        return self.nash_conv(strategies) / len(self.teams)


class TableSolution(Solution):
    """The values of all states of a game, and optimal strategies; made by `solve` and `best_response`.

    Args:
        table: the states and transitions.
        stages: the values of the first deciding team.
        team: the team whose values these are.
        reward: its reward.
    """

    def __init__(self, table: Table, stages: ValueIteration, team: str, reward: Reward) -> None:
        self._table = table
        self.teams = table.setup.teams
        self._stages = stages
        self.team = team
        self._reward = reward
        self._side = table.setup.teams.index(team)
        self._sign = 1.0 if self._side == 0 else -1.0
        self.error = stages.error
        self.value = self._sign * float(stages.values[-1][0]) + 0.0

    def __repr__(self) -> str:
        return f"Solution(value={self.value:.6g}, team={self.team!r}, {len(self.table)} states)"

    @property
    def table(self) -> Table:
        """The states and transitions of the game."""
        return self._table

    @cached_property
    def sees(self) -> dict[str, str]:
        """Read the sensors of the agents in all states; see `Solution`."""
        return find_sensor_information(self.table)

    @cached_property
    def bound(self) -> Bound:
        """Return the relation that follows from the sensors and the error of the values; see `Solution`."""
        numeric = self._stages.side
        blind = [team for team, seen in self.sees.items() if seen != "full"]
        sides: set[Bound] = {"upper" if team == self.team else "lower" for team in blind}
        if numeric != "exact":
            sides.add(numeric if self._side == 0 else _OPPOSITE[numeric])
        if len(sides) == 1:
            return sides.pop()
        return "none" if sides else "exact"

    # -- values -------------------------------------------------------------------------------------------------

    def value_at(self, places: Mapping[str, int | None], turn: int = 0) -> float:
        """Return the value of a state for the team; see `Solution.value_at`."""
        played = as_count(turn, "turn", 0)
        return self._find_value(self._find_state_number(places, played), played)

    def values(self, agent: str, places: Mapping[str, int | None] | None = None, turn: int = 0) -> dict[int, float]:
        """Return the values by the position of an agent; see `Solution.values`."""
        played = as_count(turn, "turn", 0)
        nodes = self.table.nodes[:, self._find_interchangeable_agents(self._find_agent(agent))]
        found = {}
        for node in np.unique(nodes).tolist():
            numbers = self.table.find_states(self._find_nodes({**(places or {}), agent: node}), played)
            if len(numbers) == 1:
                found[node] = self._find_value(numbers[0], played)
        return found

    def policy(self, team: str, places: Mapping[str, int | None] | None = None, turn: int = 0) -> list[Choice]:
        """Return the joint actions of a team in a state with their probabilities; see `Solution.policy`."""
        side = self._find_side(team)
        given = places or {}
        nodes = self._find_nodes(given)
        number = self._find_state_number(given, as_count(turn, "turn", 0))
        own, other = (
            find_action_shares(self._stages, number, self._stages.count_turns_left(turn, one), one)
            for one in (side, 1 - side)
        )
        shares = own[:, int(other[:, 0].argmax())]
        chosen = sorted(enumerate(shares.tolist()), key=lambda item: -item[1])
        played = [(share, action) for action, share in chosen if share > 0.0]
        return [Choice(share, self.table.name_actions(number, side, action, nodes)) for share, action in played]

    def _find_value(self, number: int, turn: int) -> float:
        last = self.table.last_turn
        left = -1 if last is None or self.table.by_turn else max(0, min(len(self._stages.values) - 1, last - turn))
        return self._sign * float(self._stages.values[left][number]) + 0.0

    def _find_agent(self, name: str) -> int:
        names = self.table.roster.names
        return names.index(as_known(name, "agent", names))

    def _find_interchangeable_agents(self, agent: int) -> list[int]:
        """Return the agents that are sorted together with an agent."""
        known = self.table.sorted_agents
        groups = [] if known is None else [group.tolist() for group in known.groups]
        return next((group for group in groups if agent in group), [agent])

    def _find_nodes(self, places: Mapping[str, int | None]) -> list[int]:
        nodes = list(self.table.start_places)
        for name, node in as_mapping(places, "places").items():
            nodes[self._find_agent(name)] = -1 if node is None else as_node_id(node, f"places[{shown(name)}]")
        return nodes

    def _find_state_number(self, places: Mapping[str, int | None], turn: int) -> int:
        nodes = self._find_nodes(places)
        found = self.table.find_states(nodes, turn)
        where = self.table.name_nodes(nodes)
        first = None if found else self.table.find_first_turn(nodes)
        if first is not None and turn < first:
            raise BadValue(
                f"There is no value of {where} in turn {turn}: the game reaches it in turn {first} at the earliest, "
                f"and values are known from then on. Give turn={first}, or solve a game that starts there."
            )
        if not found:
            raise BadValue(f"The game does not continue from {where} in turn {turn}: it never reaches it, or is over.")
        if len(found) > 1:
            raise BadValue(
                f"There are {len(found)} states with {where}, because rules or strategies store more than positions."
            )
        return found[0]

    def _find_side(self, team: str) -> int:
        teams = self.table.setup.teams
        return teams.index(as_known(team, "team of the solution", teams))

    # -- play ---------------------------------------------------------------------------------------------------

    def strategy(self, team: str | None = None) -> SolvedStrategy:
        """Return the strategy of a team; see `Solution.strategy`."""
        return SolvedStrategy(self._stages, self._side if team is None else self._find_side(team))

    def nash_conv(self, strategies: Mapping[str, SolvedStrategy] | None = None) -> float:
        """Return the gain of both teams together from best responses; see `Solution.nash_conv`."""
        teams = self.table.setup.teams
        given: dict[str, SolvedStrategy] = {team: self.strategy(team) for team in teams}
        given |= as_mapping(strategies or {}, "strategies")
        for team, strategy in given.items():
            if getattr(strategy, "team", None) != teams[self._find_side(team)]:
                raise BadType(
                    f"strategies[{shown(team)}] must be a strategy of this team from a solution, not "
                    f"{shown(strategy)}: gamms.solve.nash_conv takes others."
                )
        # The current rewards of the teams add up to 0.
        return sum(given[team].best_response_of_other(self._reward, self.team).value for team in teams)


_OPPOSITE: dict[Bound, Bound] = {"lower": "upper", "upper": "lower", "none": "none"}


def solve_table(setup: GameSetup, reward: Reward, discount: float, of: str) -> TableSolution:
    """Return the solution of a game with one or two deciding teams; `of` is the team that gets the reward."""
    share = check_discount(reward, discount)
    table = explore(setup, by_winner=is_using_winner(reward), merges=not callable(reward))
    stages = ValueIteration(table, find_rewards(table, reward, share, of), TOLERANCE)
    return TableSolution(table, stages, setup.teams[0], reward)


def check_discount(reward: Reward, discount: float) -> float:
    """Return the checked discount, and check the reward, before a game is explored.

    Raises:
        BadType, BadValue: the discount or the reward is impossible.
    """
    share = as_float(discount, "discount")
    if not 0.0 < share <= 1.0:
        raise BadValue(f"discount must be above 0 and at most 1, not {shown(discount)}.")
    if callable(reward):
        as_function_of(reward, "reward", "a transition")
    else:
        as_choice(reward, "reward", REWARDS)
    return share


def is_using_winner(reward: Reward) -> bool:
    """Return whether a reward depends on the winner."""
    return reward not in ("score", "turns")


TOLERANCE = 1e-10  # for values of games without a last turn


def list_teams(scenario: Scenario, team: str | None) -> tuple[str, ...]:
    """Return the teams of a scenario, a given one first.

    Raises:
        BadType: the value is not a scenario.
        UnknownName (KeyError): the team does not exist.
    """
    if not isinstance(scenario, Scenario):
        raise BadType(f"A scenario is needed, such as gamms.scenario.load(file), not {shown(scenario)}.")
    teams = tuple(name for name, spec in scenario.spec.teams.items() if spec.count or spec.agents)
    if team is not None and team not in teams:
        raise UnknownName("team", team, teams)
    return tuple(sorted(teams, key=lambda one: one != (team or teams[0])))


def make_setup(
    scenario: Scenario,
    teams: tuple[str, ...],
    others: Mapping[str, Any],
    *,
    turns: int | None,
    seed: int | None,
    max_states: int,
    limit: str = "max_states",
) -> GameSetup:
    """Return the checked setup of a game; `limit` is the name of the argument that bounds the number of states."""
    start = (scenario.spec.seed or 0) if seed is None else seed
    last = None if turns is None else as_count(turns, "turns")
    return GameSetup(scenario, as_int(start, "seed"), teams, others, last, as_count(max_states, limit), limit)


def read_rewards(table: Table, reward: Reward, discount: float, of: str) -> Rewards:
    """Return the rewards of a table's first team by row, from the reward of team `of`, even if all are 0.

    Raises:
        BadType, BadValue: the reward is impossible.
    """
    sign = 1.0 if of == table.setup.teams[0] else -1.0
    usual = sign * _compute_rewards(table, table.usual, reward, of)
    last = None if table.last is None else sign * _compute_rewards(table, table.last, reward, of)
    return Rewards(usual, last, discount)


def find_rewards(table: Table, reward: Reward, discount: float, of: str) -> Rewards:
    """Return the rewards of a table's first team by row, from the reward of team `of`.

    Raises:
        BadType, BadValue: the reward is impossible, or always 0.
    """
    found = read_rewards(table, reward, discount, of)
    usual, last = found.usual, found.last
    if not usual.any() and (last is None or not last.any()):
        why = {"score": "no turn gives points", "win": "no turn ends with a winner"}.get(str(reward), "it is always 0")
        raise BadValue(
            f"With reward={shown(reward)} all play is worth 0, because {why}: give another of {REWARDS}, or a function."
        )
    if reward == "score":
        _warn_of_worthless_wins(table, usual, last)
    return found


def _warn_of_worthless_wins(table: Table, usual: FloatArray, last: FloatArray | None) -> None:
    """Warn of teams whose wins give no points."""
    turns = [(table.usual.winner, usual)]
    turns += [] if table.last is None or last is None else [(table.last.winner, last)]
    for number, team in enumerate(table.roster.teams):
        given = [rewards[winner == number] for winner, rewards in turns]
        if any(map(len, given)) and not any(map(np.any, given)):
            getLogger("gamms").warning(
                f"With reward='score' a win of team {shown(team)} is worth nothing, because the rules that end the "
                "game give no points for it. With reward='win' a win counts 1, and a loss -1."
            )


def _compute_rewards(table: Table, outcomes: Outcomes, reward: Reward, of: str) -> FloatArray:
    teams = table.roster.teams
    mine = table.roster.teams.index(of)
    if callable(reward):
        given = [as_float(reward(transition), "reward") for transition in table.list_transitions(outcomes)]
        return np.array(given, np.float64)
    if reward == "turns":
        return np.full(len(outcomes.after), -1.0)
    if reward == "win":
        return np.where(outcomes.winner == mine, 1.0, np.where(outcomes.winner >= 0, -1.0, 0.0))
    others = [place for place in range(len(teams)) if place != mine]
    gains: FloatArray = outcomes.gains[:, mine] - outcomes.gains[:, others].sum(axis=1) / max(1, len(others))
    return gains
