"""The learning agents in the games of a batch: the basis of all environments of this package."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, Literal, NamedTuple, Self, get_args

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_function_of, as_int, as_items, as_mapping
from gamms.errors import BadType, BadValue, GammsError
from gamms.game.array_functions.given import OutsideActions
from gamms.game.array_functions.view import (
    ArrayView,
    LearnerWriter,
    count_actions,
    encode_vectors,
    get_movement,
    get_nodes,
    list_lasting_deeds,
    make_writer,
    set_width,
)
from gamms.game.batch import (
    Batch,
    MostAgents,
    can_play_in_one_call,
    can_restart_in_one_call,
    change_strategies,
    find_opponent_names,
    find_pools,
    has_first_roads,
    list_newest_sources,
    list_sources,
    make_source_view,
    prepare_starts,
    reset_alike,
    step_with,
)
from gamms.game.block.vectors import ObservationVectors
from gamms.game.deeds import parse_field
from gamms.game.settings import get_rule_spec
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.deeds import DeedChoices, get_choices
from gamms.rl.turns import ActionHistory, GameOutcomes, ScriptedActions, Turn, TurnArrays, TurnOutcome
from gamms.scenario import Scenario
from gamms.text import shown
from gamms.typing import AgentType
from gamms.visual import Engine

Float32Array = np.ndarray[tuple[int, ...], np.dtype[np.float32]]
ActionArray = np.ndarray[tuple[int, ...], np.dtype[np.integer[Any]]]
Seeds = int | Sequence[int | None] | None  # of games: one seed for all, or one for each

_MOST_OTHERS = 8
_MOST_ACTIONS = 4096
_EDGES_AROUND = 2  # that an agent on an edge may name: this one, and the one back
_STARTS_AHEAD = 2  # starts of each game that are drawn
_OFTEN = 4  # they are drawn again when as many games as one in this many have begun
_GAMMS = str(Path(__file__).parents[1])  # the folder of GAMMS


Begins = Literal["ended", "waiting"] | None  # which games a step begins again

Moves = Literal["nodes", "edges"]
"""What the numbers of actions stand for: legal nodes, or legal edges."""
Observation = Callable[[ArrayView], Any]
"""Maps a view of a team's agents to numbers, (games, agents, …).

Its attribute `bounds` may give the smallest and largest number; its attribute `of_each` may tell that an agent's
numbers are the same in a view of this agent alone, because they come from its own sensors.
"""
Reward = Callable[[Turn], Any]
"""Maps a turn to numbers for the agents of a team, (games, agents), or one for all of them, (games,) or (games, 1)."""


class GamesCheckpoint(NamedTuple):
    """A checkpoint of games for copies: their seeds, and their actions since they began.

    Attributes:
        seeds: the seeds of the current games; None: no game has begun.
        runs: (games,) the run of each game, or the named seed of its first episode.
        is_named: (games,) whether it is a named seed.
        episodes: (games,) the number of episodes since then.
        prefix: the actions.
        set_of: (games,) the number of the others that each game plays against, see `Learners.set_others`; 0: those with
            which the learners were made.
        newest: the number of the others of games that begin.
        others: number -> others, without 0.
    """

    seeds: tuple[int, ...] | None
    runs: IntArray
    is_named: BoolArray
    episodes: IntArray
    prefix: ActionHistory
    set_of: IntArray
    newest: int
    others: dict[int, Mapping[str, Any]]


class Learners:
    """The agents of some teams of a scenario, in many games, as arrays: observations in, actions out.

    Args:
        scenario: the scenario to play.
        num_games: the number of games.
        teams: the learning teams, one or several; None: all. The others play their own strategies.
        agent: the only learning agent, instead of teams; the others of its team play their strategies.
        others: strategies by team or agent, which replace the scenario's.
        observation: the observation function; None: `default_observation`.
        reward: the reward function; None: the change of the score of the agent's team.
        seed: the seed of the run, from which those of all games are derived; see `begin_from`.
        one_by_one: deprecated, without effect.
        vis_engine: shows the games, one by one.
        record: deprecated, without effect: actions are kept, so that `games.record` can write recordings.
        most_agents: the most agents of each team over a game, or team -> number; see `Scenario.batch`.
        threads: the number of threads for games that the core supports completely; other games use one.
        maps: several maps instead of that of the scenario, or name -> map; see `Scenario.batch`. Observation and reward
            functions are called for the games of each map.
        moves: "nodes": action k goes to the k-th legal node; "edges": it takes the k-th of the legal edges, from 1, and
            action 0 is that of "nodes".

    Attributes:
        games: the batch.
        scenario, observation, agent: see above.
        teams: the learning teams.
        names: the names of the agents, team by team, sorted within a team.
        num_actions: the largest number of actions; action 0 stays.
        num_legal: the largest number of legal nodes, for which the default observation has entries.
        by_edges: whether actions are numbers of legal edges.
        deeds: the deed choices of agents; None: the scenario declares no deeds.
        flies: (agents,) whether agents fly.
        any_fly, all_fly: whether some of them, or all, fly.
        reach_m: (agents,) the reach of flying agents in a turn, map units; 0 for the others.
        is_there: (games, agents) whether agents are in the game, dead or alive; the others do not exist yet.
        has_begun: whether games have begun; before that, environments play no turn.
        first_game: the number of the first game in its run, of which other processes may play earlier games.
        may_return: whether a rule brings back agents that are out; then they wait, and end with their games.
        begun: the numbers of the games that have begun again in the last step; see `step`.
        drawn: what each game plays with, for infos, each (games,): "opponent.<team>", the name of the strategy of each
            other team that `others` names, and of the member that it has drawn if it plays a pool; and with several
            maps "map" and "map_spec", see `ArrayView`.

    Raises:
        UnknownName (KeyError): a team does not exist.
        BadValue: an agent may go to more than 4096 nodes in a turn; no rule gives scores and no reward is given; or
            there are both several maps and deeds.
    """

    def __init__(  # noqa: PLR0913 - what the environments are given
        self,
        scenario: Scenario,
        num_games: int = 1,
        *,
        teams: str | Sequence[Hashable] | None = None,
        agent: str | None = None,
        others: Mapping[str, Any] | None = None,
        observation: Observation | None = None,
        reward: Reward | None = None,
        seed: int = 0,
        one_by_one: bool | None = None,
        vis_engine: Engine | None = None,
        record: bool = False,  # noqa: ARG002 - it was needed before
        most_agents: MostAgents | None = None,
        threads: int = 1,
        maps: Sequence[Any] | Mapping[str, Any] | None = None,
        moves: Moves = "nodes",
    ) -> None:
        if not isinstance(scenario, Scenario):
            raise BadType(f"A scenario is needed, such as gamms.scenario.load(file), not {shown(scenario)}.")
        for name, function, given in (("observation", observation, "a view"), ("reward", reward, "a turn")):
            if function is not None:
                as_function_of(function, name, given)
        self.by_edges = as_choice(moves, "moves", get_args(Moves)) == "edges"
        self.scenario = scenario
        self.observation = observation or default_observation
        self._reward = reward
        self._threads = min(as_count(threads, "threads"), as_count(num_games, "num_games"))
        self._observe = observation or partial(default_observation, threads=self._threads)
        first_others = dict(as_mapping(others or {}, "others"))
        self.agent = agent
        self._scripted = None if agent is None else ScriptedActions()
        number = as_count(num_games, "num_games")
        self.first_game = 0
        self._runs = np.full(number, as_int(seed, "seed"))
        self._is_named = np.zeros(number, np.bool_)
        self._episodes = np.zeros(number, np.int64)
        self.games: Batch = scenario.batch(
            seeds=self._make_seeds(np.arange(number), self._episodes),
            strategies=self._add_scripted(first_others),
            record=True,
            one_by_one=one_by_one,
            vis_engine=vis_engine,
            most_agents=most_agents,
            maps=[*maps.values()] if isinstance(maps, Mapping) else maps,
        )
        self._sets: dict[int, Mapping[str, Any]] = {0: first_others}  # of others: those that games play, and the newest
        self._newest = 0
        self._set_of = np.zeros(number, np.int64)
        self.begun: IntArray = np.zeros(0, np.int64)
        self._num_used = 0  # how many games have begun since their next starts were drawn
        try:
            self._set_learners((teams,) if isinstance(teams, str) else teams, agent)
            self._refuse_learners(first_others)
            self.games.game.internals.warn_of_stuck_agents(has_learners=True)
        except BaseException:
            self.games.close()
            raise

    def _set_learners(self, teams: Sequence[Hashable] | None, agent: str | None) -> None:
        """Determine the learning agents, and refuse games that cannot be learned."""
        if agent is None:
            self.teams = self.games.teams if teams is None else tuple(as_items(teams, "team", "names of teams"))
            if not self.teams:
                raise BadValue("team names no team: give one, several, or None for all.")
        else:
            self.teams = self.games.observe_agent(agent, map=0)["team"]
            if teams is not None and tuple(teams) != self.teams:
                raise BadValue(
                    f"Agent {shown(agent)} is of the team {shown(self.teams[0])}: give agent= without team=."
                )
        views = self._make_views(0)
        self._opposing: list[Hashable] = []  # the teams in `drawn`
        self.drawn = self._begin_drawn()
        self._add_drawn_teams()
        self._specs = [self._make_views(number)[0].map_spec for number in range(self.games.num_maps)]
        self.num_legal = self._count_most_legal()
        self.num_actions = max(map(count_edge_actions, self._make_first_views())) if self.by_edges else self.num_legal
        self.deeds = self._make_deed_choices(views[0])
        if self._scripted is not None:
            self._scripted.begin(self.games, self.deeds, by_edges=self.by_edges)
        self.has_begun = False
        ends = np.cumsum([0, *(len(view.agents) for view in views)]).tolist()
        self._columns = [slice(first, last) for first, last in pairwise(ends)]  # columns of the agents of each team
        self._shape = (len(self.games), ends[-1])
        self.is_there: BoolArray = np.ones(self._shape, np.bool_)
        self._can_come = not views[0].roster.is_first.all()
        self._known_views: list[tuple[ArrayView, ...]] | None = None  # see `_now`
        game = self.games.game
        self.may_return = any(_may_bring_back(one.rule) for one in game.rules)
        self._turn = TurnArrays(self._shape, may_return=self.may_return)
        self._given = self._split_moves()
        self._begin_writing()
        self._update_legal_moves()
        self.names: tuple[str, ...] = tuple(chain.from_iterable(view["name"] for view in views))
        learners = [views[0].roster.agents[number] for number in chain.from_iterable(view.agents for view in views)]
        self.flies: BoolArray = np.array([one.type is AgentType.AERIAL for one in learners], np.bool_)
        self.any_fly = bool(self.flies.any())
        self.all_fly = bool(self.flies.all())
        num_heads = 1 if self.deeds is None else 2
        self._prefix = ActionHistory(self._shape, num_heads, flies=self.any_fly)
        reach = [one.speed or 0.0 if flies else 0.0 for one, flies in zip(learners, self.flies, strict=True)]
        self.reach_m: FloatArray = np.array(reach, np.float64)
        if self._reward is None and not any(_may_give_scores(one.rule) for one in game.rules):
            raise BadValue(
                "No rule of this scenario gives scores, from which rewards are made: give reward=, a function of a "
                "turn, or add a rule such as tag with a score."
            )

    def _add_scripted(self, others: Mapping[str, Any]) -> dict[str, Any]:
        """Return the strategies of others, and that of the only learning agent."""
        own = {} if self.agent is None or self._scripted is None else {self.agent: self._scripted}
        return {**others, **own}

    def _refuse_learners(self, others: Mapping[str, Any]) -> None:
        """Refuse strategies of other agents that are for agents or teams that learn."""
        learning = [*self.names, *(self.teams if self.agent is None else ())]
        for name in others:
            if name in learning:
                raise BadValue(
                    f"others has a strategy for {shown(name)}, which learns: leave it out, or let team= name the teams "
                    "that learn."
                )

    def _begin_drawn(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the columns `drawn` for the maps that games draw; the values are set when games begin."""
        games = len(self.games)
        has_maps = self.games.num_maps > 1
        found: dict[str, np.ndarray[Any, Any]] = {"map": np.zeros(games, np.int64)} if has_maps else {}
        return found | ({"map_spec": np.full(games, None, object)} if has_maps else {})

    def _add_drawn_teams(self) -> None:
        """Add the teams to `drawn` that others name, or that play a pool."""
        named = [*find_pools(self.games), *(team for team in self.games.teams if team in self._sets[self._newest])]
        for team in named:
            if team not in self._opposing and team not in self.teams:
                self._opposing.append(team)
                self.drawn[f"opponent.{team}"] = find_opponent_names(self.games, team, np.arange(len(self.games)))

    def _make_deed_choices(self, view: ArrayView) -> DeedChoices | None:
        """Return the deed choices of agents; None: the scenario declares no deeds."""
        declared = self.games.game.settings()["deeds"].items()
        fields = {deed: {key: parse_field(kind) for key, kind in of.items()} for deed, of in declared}
        if fields and self.games.num_maps > 1:
            raise BadValue("Deeds of learners are for games on one map: leave maps= out, or declare no deeds.")
        return get_choices(view, fields)

    def _make_first_views(self) -> list[ArrayView]:
        """Return a view of the games on each map."""
        return [self._make_views(number)[0] for number in range(self.games.num_maps)]

    def _count_most_legal(self) -> int:
        """Return the largest number of legal nodes on any map, and give observations on all maps this size."""
        views = self._make_first_views()
        most = max(map(count_actions, views))
        for view in views:
            set_width(view, most)
        return most

    def close(self) -> None:
        """Close the games."""
        self.games.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def bounds(self) -> tuple[float, float]:
        """The smallest and the largest number in an observation."""
        least, largest = getattr(self.observation, "bounds", (-np.inf, np.inf))
        return float(least), float(largest)

    # -- playing ------------------------------------------------------------------------------------------------

    def observe_ended(self) -> tuple[Any, BoolArray]:
        """Return the observations and legal actions in the games `begun` before they began again."""
        assert self._writer is not None  # noqa: S101 - it has begun them
        legal = self._writer.last_legal[self.begun]
        if self.by_edges:  # they have ended
            legal = np.zeros((len(self.begun), *self.masks.shape[1:]), np.bool_)
            legal[..., 0] = True
        return self._writer.last_values[self.begun], legal

    def observe(self, which: IntArray | None = None) -> Any:
        """Return the observations of all agents, (games, agents, …), in the games `which`; None: all."""
        if self._writer is not None and self._is_written and self._has_vectors:
            values = self._writer.values
            return values if which is None else values[which]
        if which is None:
            return join_by_agents([self._observe_views(views) for views in self._now])
        are_alike = all(type(view) is ArrayView for view in chain.from_iterable(self._now))  # with the same roads
        if not are_alike or not getattr(self.observation, "of_each", False):  # it may need all games
            return self.observe()[which]
        return join_by_agents([self._observe_views(_restrict_views(views, which)) for views in self._now])

    def _observe_views(self, views: Sequence[ArrayView]) -> Any:
        """Return the observations of agents in the views of all maps, in the order of the games."""
        found = [self._observe_view(view) for view in views]
        shapes = {one.shape[2:] for one in found}
        if len(shapes) > 1:
            raise BadValue(
                f"observation must give arrays of one shape on all maps, not {shown(sorted(shapes))} for an agent: "
                "pad it to a fixed number of entries, as rl.neighbourhood(2, nodes=12) and rl.graph(nodes=150) do."
            )
        return _join_in_order(found, views)

    def _observe_view(self, view: ArrayView) -> Any:
        return self._check_result(self._observe(view), view, "observation")

    def step(
        self,
        actions: ActionArray,
        deeds: ActionArray | None = None,
        flights: FloatArray | None = None,
        *,
        begins: Begins = None,
    ) -> TurnOutcome:
        """Play one turn of the unfinished games.

        With `begins`, the core begins ended games again in the same call, with their next seeds: those in `begun`. The
        caller begins the others, whose next start is not drawn yet, or which need functions: `begin_again`.

        Args:
            actions: (games, agents); after an illegal action the agent stays.
            deeds: (games, agents) numbers of deed choices; an illegal one is not done. None: agents only move.
            flights: (games, agents, 3) the flights of flying agents: east, north and up, as shares of their reach in a
                turn. A flight longer than 1 is shortened to 1; one that is not finite hovers. None: all hover.
            begins: "ended": games begin again that end in this turn; "waiting": those that had ended before; None: none
                do.
        """
        self._refuse_closed()
        turn = self._turn
        turn.moves[:] = self._check_actions(actions, self.num_actions)
        heads = [turn.moves]
        given = self._given
        if self.by_edges:
            heads, given = self._take_edges(turn.moves)
        if deeds is not None and self.deeds is not None:
            done = self._check_actions(deeds, len(self.deeds))
            heads.append(np.where(are_in(self.deed_masks, done), done, 0))
            given = self._add_deeds(given, heads[1])
        flown = None
        if flights is not None and self.any_fly:
            flown = limit_to_reach(np.asarray(flights), self.reach_m, self._shape)
            given = self._add_flights(given, flown)
        if self._scripted is not None:
            given = self._store_script(given, heads, flown)
        before = None if self._reward is None else self._now
        is_at_once = self._is_written and can_play_in_one_call(self.games, given)
        writer = self._writer if is_at_once else None
        scores = {} if is_at_once and before is None else self.games.scores
        if writer is None:
            turn.begin()
        else:
            writer.waits = begins == "waiting"
            writer.begins = begins is not None and before is None and self._can_begin()
        step_with(self.games, given, self._threads, writer=writer)
        self._prefix.add(~turn.was_over, heads, flights)
        self._known_views = None
        self.begun = np.zeros(0, np.int64) if writer is None else writer.begun
        if len(self.begun):
            self._episodes[self.begun] += 1
            self._set_of[self.begun] = self._newest
            self._note_begun(self.begun)
        if writer is not None and before is None:
            return turn.make_outcome(writer.num_ended)
        if writer is None:
            self._update_legal_moves()
        self._earn(before, scores)
        outcome = turn.end()
        if before is not None:
            self._refuse_no_numbers(outcome.rewards)
        return outcome

    def _can_begin(self) -> bool:
        """Return whether the core can begin games again in a step; draw starts if some games have used theirs."""
        if not (self._has_vectors and can_restart_in_one_call(self.games)):
            return False
        if self._num_used * _OFTEN >= len(self.games):
            self._num_used = 0
            self._draw_starts()
        return True

    def _draw_starts(self) -> None:
        """Draw the next starts of games, so that they may begin again in steps."""
        left = self._turn.may_begin
        pairs = [(np.flatnonzero(left <= later), later) for later in range(_STARTS_AHEAD)]
        which = np.concatenate([games for games, _ in pairs])
        later = np.concatenate([np.full_like(games, number) for games, number in pairs])
        seeds = self._make_seeds(which, self._episodes[which] + later)
        with suppress(GammsError):  # agents do not fit in a game; `begin` raises the error when that game is reached
            prepare_starts(self.games, which, later, seeds, _STARTS_AHEAD)
            left[:] = _STARTS_AHEAD

    def _store_script(
        self, given: dict[Hashable, OutsideActions], heads: Sequence[IntArray], flown: FloatArray | None
    ) -> dict[Hashable, OutsideActions]:
        """Store actions for the strategy of the only agent; return the actions to give, none if it is called."""
        assert self._scripted is not None  # noqa: S101 - the caller has looked
        self._turn.begin()  # only legal moves are stored
        self._scripted.take(self.games.turn, heads[0], heads[1] if len(heads) > 1 else None, flown)
        return given if flown is None and self.games.is_in_arrays else {}

    def _earn(self, before: Sequence[Sequence[ArrayView]] | None, scores: Mapping[Any, FloatArray]) -> None:
        """Write the rewards of a turn, also for agents that did not take part."""
        gains = {key: numbers - scores.get(key, 0.0) for key, numbers in self.games.scores.items()}
        earned = self._turn.earned
        if self._reward is None or before is None:
            for team, columns in zip(self.teams, self._columns, strict=True):
                earned[:, columns] = gains[team][:, None] if team in gains else 0.0
            return
        earned[:] = 0.0
        outcomes = GameOutcomes(self.games)
        for team, views, views_now, columns in zip(self.teams, before, self._now, self._columns, strict=True):
            for was, now in zip(views, views_now, strict=True):
                none = partial(np.zeros, len(now.games))
                own = defaultdict(none, {key: numbers[now.games] for key, numbers in gains.items()})
                turn = Turn(team, was, now, own, outcomes)
                earned[now.games, columns] += self._check_result(self._reward(turn), now, "reward")

    def are_legal(self, actions: ActionArray) -> BoolArray:
        """Return whether actions are legal, (games, agents)."""
        counts = self._count_edges() if self.by_edges and self._is_written else self._turn.counts
        found: BoolArray = (actions >= 0) & (actions < counts)
        return found

    def begin_all(self, seed: int | Sequence[int | None] | None = None) -> None:
        """Begin all games: those of a run, or with named seeds, see `begin_from`; None: with their next seeds."""
        if seed is not None:
            self.begin_from(seed)
        self.begin_again(np.arange(len(self.games)))

    def begin_from(self, seed: int | Sequence[int | None], which: IntArray | None = None) -> None:
        """Set the run of games, or the seeds of their next episode.

        Episode e of game i of a run has a seed derived from the three numbers. Derived seeds are 2 ** 62 or larger, so
        that no smaller one occurs in training. A seed in a list is that of a game itself, as in `Scenario.play`;
        the game's later episodes are those of the run of this number.

        Args:
            seed: the seed of the run; or a list with the seed of each game of the batch, in which None keeps the run of
                the game.
            which: the numbers of games; None: all.

        Raises:
            BadType, BadValue: these are not seeds, or not one for each game.
        """
        games = np.arange(len(self.games)) if which is None else which
        if isinstance(seed, Iterable):
            given = [None if one is None else as_int(one, "seed") for one in as_items(seed, "seed", "seeds")]
            if len(given) != len(self.games):
                raise BadValue(f"seed has {len(given)} seeds for {len(self.games)} games: give one for each.")
            games = np.array([game for game in games.tolist() if given[game] is not None], np.int64)
            self._runs[games] = [given[game] for game in games.tolist()]
        else:
            self._runs[games] = as_int(seed, "seed")
        self._is_named[games] = isinstance(seed, Iterable)
        self._episodes[games] = 0
        self._turn.may_begin[games] = 0

    def begin_again(self, which: IntArray) -> None:
        """Begin the next episodes of games; see `begin_from`."""
        seeds = self._make_seeds(which, self._episodes[which])
        self._episodes[which] += 1
        self.begin(which, seeds)

    def _make_seeds(self, which: IntArray, episodes: IntArray) -> list[int]:
        """Return the seeds of episodes of games."""
        runs = self._runs[which].tolist()
        seeds = kernels.compute_run_seeds(runs, (self.first_game + which).tolist(), episodes.tolist())
        for place in np.flatnonzero(self._is_named[which] & (episodes == 0)).tolist():
            seeds[place] = runs[place]
        return seeds

    def _refuse_closed(self) -> None:
        if self.games.is_closed:
            raise BadValue("This environment is closed: make another one with the functions of gamms.rl.")

    def set_others(self, others: Mapping[str, Any] | None) -> None:
        """Replace the strategies of other agents and teams: in each game from its next start on.

        A game that is under way goes on with the strategies that it began with, beside games with the new ones. A game
        that begins later is the same as one of learners that were made with these others.

        Args:
            others: strategies by team or agent, in place of all earlier others: teams that it does not name play the
                strategies of the scenario. None: all do.

        Raises:
            UnknownName (KeyError): there is no such team or agent.
            BadType, BadValue: a strategy is for agents that learn, or is no strategy; then nothing changes.
        """
        self._refuse_closed()
        given = dict(as_mapping({} if others is None else others, "others"))
        self._refuse_learners(given)
        change_strategies(self.games, self._add_scripted(given))
        for number in list_newest_sources(self.games):
            set_width(self._make_views(number)[0], self.num_legal)
        self._newest += 1
        self._sets[self._newest] = given
        self._sets = {number: self._sets[number] for number in {*self._set_of.tolist(), self._newest}}
        self._add_drawn_teams()

    def begin(self, which: IntArray, seeds: Sequence[int], *, keeps_others: bool = False) -> None:
        """Begin games again, with these seeds, and with the newest others, or the same ones."""
        self._refuse_closed()
        if keeps_others:
            reset_alike(self.games, which, seeds)
        else:
            self.games.reset(which, seeds=seeds)
            self._set_of[which] = self._newest
        self._turn.may_begin[which] = 0
        self.has_begun = True
        self._note_begun(which)
        if self._writer is not None:
            self._writer.move(self.games.maps)
        self._update_legal_moves(which)

    def _note_begun(self, which: IntArray) -> None:
        """Note what games that have begun play with, and forget their actions."""
        for team in self._opposing:
            self.drawn[f"opponent.{team}"][which] = find_opponent_names(self.games, team, which)
        if "map" in self.drawn:
            self.drawn["map"][which] = self.games.maps[which]
            for game in which.tolist():
                self.drawn["map_spec"][game] = self._specs[self.games.maps[game]]
        self._prefix.begin(which)
        self._num_used += len(which)

    def carried(self) -> GamesCheckpoint:
        """Return a checkpoint of the games, for `restore` in learners of the same scenario and options."""
        self._refuse_closed()
        seeds = tuple(self.games.seeds) if self.has_begun else None
        others = {number: one for number, one in self._sets.items() if number}
        begun = seeds, self._runs.copy(), self._is_named.copy(), self._episodes.copy()
        return GamesCheckpoint(*begun, self._prefix.cut(), self._set_of.copy(), self._newest, others)

    def restore(self, carried: GamesCheckpoint) -> None:
        """Replay games up to a checkpoint, so that all reach it in the same step.

        A game with fewer turns begins later, so that it reaches its last turn together with the others.
        """
        if carried.seeds is not None:
            seeds = np.array(carried.seeds, object)
            steps = carried.prefix.steps
            behind = steps.max() - steps
            for number in sorted({*carried.set_of.tolist()}):
                which = np.flatnonzero(carried.set_of == number)
                if number:
                    self.set_others(carried.others[number])
                self.begin(which, seeds[which].tolist())
            for turn in range(int(steps.max()) + 1):
                which = np.flatnonzero(behind == turn)
                if turn and len(which):
                    self.begin(which, seeds[which].tolist(), keeps_others=True)
                self.observe()  # an observation function may have memory
                if turn < steps.max():
                    self.step(*carried.prefix.get_actions(turn - behind))
        if carried.newest and (carried.seeds is None or carried.newest not in carried.set_of):
            self.set_others(carried.others[carried.newest])
        self._turn.may_begin[:] = 0
        self._runs[:] = carried.runs
        self._is_named[:] = carried.is_named
        self._episodes[:] = carried.episodes

    def whole(self) -> Float32Array:
        """Return the full state of the games as numbers, (games, entries), for a centralized critic.

        For each agent of all teams, sorted by name: `alive`, `x` and `y`, and if an agent flies `z`, as shares of the
        map; then the share n / (n + 100) after n turns, and the scores of the teams.
        """
        on_maps = [self._observe_whole(number) for number in list_sources(self.games)]
        of_agents = _join_in_order([values for values, _ in on_maps], [view for _, view in on_maps])
        known = self.games.scores
        scores = [known.get(team, np.zeros(len(self.games))) for team in self.games.teams]
        parts = (
            of_agents.reshape(len(self.games), -1),
            (self.games.turn / (self.games.turn + 100.0))[:, None],
            np.stack(scores, axis=1),
        )
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def _observe_whole(self, number: int) -> tuple[FloatArray, ArrayView]:
        """Return the numbers of `whole` for the agents in the games of a source, and a view of these games."""
        views = [make_source_view(self.games, number, team) for team in self.games.teams]
        order = np.argsort(np.concatenate([view.agents for view in views]))
        xy = np.concatenate([view["xy"] for view in views], axis=1)[:, order]
        alive = np.concatenate([view.mask for view in views], axis=1)[:, order]
        nodes = views[0].streets.columns.xy
        low = nodes.min(axis=0)
        high = nodes.max(axis=0)
        shares = (xy - (low + high) / 2.0) * (2.0 / _measure_longer_side(nodes))
        if any(agent.type is AgentType.AERIAL for agent in views[0].roster.agents):
            z = np.concatenate([view["z"] for view in views], axis=1)[:, order]
            shares = np.concatenate((shares, z[..., None] * (2.0 / _measure_longer_side(nodes))), axis=2)
        return np.concatenate((alive[..., None], np.where(alive[..., None], shares, 0.0)), axis=2), views[0]

    def names_by_team(self) -> dict[Hashable, tuple[str, ...]]:
        """Return team -> the names of its agents."""
        return {team: views[0]["name"] for team, views in zip(self.teams, self._now, strict=True)}

    # -- inside -------------------------------------------------------------------------------------------------

    def _make_views(self, number: int) -> list[ArrayView]:
        """Return the views of the teams in the games of a source, which may be empty; the first are of the maps."""
        return [make_source_view(self.games, number, team, self.agent) for team in self.teams]

    def _begin_writing(self) -> None:
        """Choose whether the core writes the legal actions, and the observations."""
        self._writer: LearnerWriter | None = None
        self._is_written = False  # whether the writer has written the current turn
        self._has_vectors = self.observation is default_observation and not list_lasting_deeds(self._make_views(0)[0])
        self._roster = self.games.roster
        if self.games.is_in_arrays:
            views = self._make_first_views()
            others = min(_count_public_agents(views[0]) - 1, _MOST_OTHERS) if self._has_vectors else None
            members = np.concatenate([view.agents for view in self._make_views(0)])
            self._writer = make_writer(views, self.games.maps, members, self._turn, others, self._threads)
            self._members = members
            if self.by_edges and self._writer is not None:
                self._edge_table = EdgeTable(views)

    def _list_team_views(self) -> list[tuple[ArrayView, ...]]:
        """Return for each team a view for each source that has games: a map, with the same others."""
        by_source = [self._make_views(number) for number in list_sources(self.games)]
        return list(zip(*by_source, strict=True))

    @property
    def _now(self) -> list[tuple[ArrayView, ...]]:
        """The views of the current games; see `_list_team_views`."""
        if self._known_views is None:
            self._known_views = self._list_team_views()
        return self._known_views

    def _update_legal_moves(self, which: IntArray | None = None) -> None:
        """Update what agents may do, and see if the core writes it; `which`: the games that were reset; None: all."""
        self._known_views = None
        if self.games.roster is not self._roster:
            self._begin_writing()
        turn = self._turn
        turn.over[:] = self.games.is_over
        turn.late[:] = self.games.truncated if turn.over.any() else False
        was_written = self._is_written
        self._is_written = self._writer is not None and self.games.is_in_arrays and has_first_roads(self.games)
        if self._writer is not None and self._is_written:
            self._writer.look(which if was_written else None)
            return
        turn.alive[:] = join_by_agents([_join_in_order([view.mask for view in views], views) for views in self._now])
        if self._can_come:
            there = [_join_in_order([view.is_there[:, view.agents] for view in views], views) for views in self._now]
            self.is_there = join_by_agents(there)
        if self.by_edges:
            self._edges = self._list_legal_edges()
            turn.counts[:] = 1 + (self._edges >= 0).sum(axis=-1)
        else:
            turn.counts[:] = join_by_agents(
                [_join_in_order([view.counts for view in views], views) for views in self._now]
            )
        self._masks = np.empty((*self._shape, self.num_actions), np.bool_)
        turn.write_masks(self._masks)

    @property
    def masks(self) -> BoolArray:
        """The legal actions, (games, agents, actions); only 0 for dead agents and in finished games."""
        if self._writer is None or not self._is_written:
            return self._masks
        return np.arange(self.num_actions) < self._count_edges()[..., None] if self.by_edges else self._writer.legal

    @property
    def alive(self) -> BoolArray:
        """Whether agents take part, (games, agents)."""
        return self._turn.alive.copy()

    @property
    def is_over(self) -> BoolArray:
        """Whether games have ended, (games,)."""
        return self._turn.over.copy()

    @property
    def deed_masks(self) -> BoolArray:
        """A mask of the agents' deed choices, (games, agents, choices); only 0 for dead agents and in finished games.

        A rule may still refuse a deed.
        """
        if self.deeds is None:
            return np.ones((*self._shape, 1), np.bool_)
        masks = np.concatenate([self.deeds.compute_masks(view) for (view,) in self._now], axis=1)
        masks[..., 1:] &= ~self.is_over[:, None, None]
        return masks

    def _split_moves(self) -> dict[Hashable, OutsideActions]:
        """Return team -> the moves of its agents in `TurnArrays.moves`, legal when a turn begins."""
        moves = self._turn.moves
        options: dict[str, Any] = {"may_stay": True, "are_legal": True, "name": self.agent}
        return {
            team: OutsideActions(moves[:, columns], {}, {}, **options)
            for team, columns in zip(self.teams, self._columns, strict=True)
        }

    def _list_legal_edges(self) -> IntArray:
        """Return the ids of the edges of each action but the first, (games, agents, actions - 1); -1: none."""
        found = np.full((*self._shape, self.num_actions - 1), -1)
        for views, columns in zip(self._now, self._columns, strict=True):
            for view in views:
                edges = view["legal_edges"][..., : found.shape[-1]]
                found[view.games, columns, : edges.shape[-1]] = edges
        return found

    def _count_edges(self) -> IntArray:
        """Return the number of actions of each agent in a turn that the writer has written, (games, agents)."""
        takes_part = self._turn.alive & ~self._turn.over[:, None]
        nodes = get_nodes(self._make_views(0)[0], self._members)
        return np.where(takes_part, 1 + self._edge_table.count(self.games.maps, nodes), 1)

    def _take_edges(self, chosen: IntArray) -> tuple[list[IntArray], dict[Hashable, OutsideActions]]:
        """Return the legal actions, as the only head, and the actions of teams that take their edges.

        Args:
            chosen: (games, agents) the actions; where the core writes, replaced by the moves to the ends of the edges.
        """
        moves = np.zeros_like(chosen)
        if self._is_written:
            heads = [np.where((chosen >= 0) & (chosen < self._count_edges()), chosen, 0)]
            nodes = get_nodes(self._make_views(0)[0], self._members)
            edges, moves = self._edge_table.find(self.games.maps, nodes, heads[0])
            chosen[:] = moves
        else:
            heads = [chosen]
            takes_edge = (chosen > 0) & (chosen < self._turn.counts) & self._turn.alive
            numbers = np.where(takes_edge, chosen - 1, 0)[..., None]
            edges = np.where(takes_edge, np.take_along_axis(self._edges, numbers, axis=-1)[..., 0], -1)
        return heads, {
            team: one._replace(moves=moves[:, columns], edges=edges[:, columns], leads=self._is_written)
            for (team, one), columns in zip(self._given.items(), self._columns, strict=True)
        }

    def _add_deeds(self, given: dict[Hashable, OutsideActions], done: IntArray) -> dict[Hashable, OutsideActions]:
        """Return actions with the deeds of agents."""
        assert self.deeds is not None  # noqa: S101 - the caller has looked
        deeds = [
            self.deeds.make_arguments(done[:, columns], *views)
            for columns, views in zip(self._columns, self._now, strict=True)
        ]
        return {team: one._replace(deeds=of) for (team, one), of in zip(given.items(), deeds, strict=True)}

    def _add_flights(self, given: dict[Hashable, OutsideActions], flown: FloatArray) -> dict[Hashable, OutsideActions]:
        """Return actions with the flights of agents, for the teams in which some fly."""
        return {
            team: one._replace(flights=flown[:, columns]) if self.flies[columns].any() else one
            for (team, one), columns in zip(given.items(), self._columns, strict=True)
        }

    def _check_actions(self, given: ActionArray, count: int) -> IntArray:
        """Return the caller's actions as checked integers below a count, (games, agents)."""
        found: IntArray = np.asarray(given)
        if found.shape != self._shape or found.dtype.kind not in "iu":
            raise BadValue(
                f"Actions are integers, one for each of {self._shape[0]} games and {self._shape[1]} agents, not "
                f"{found.dtype} of the shape {found.shape}."
            )
        check_range(found, count, self.names)
        return found

    def _check_result(self, given: object, view: ArrayView, what: str) -> Any:
        """Return the result of a user's function as a checked array."""
        games = len(view.games)
        agents = len(view.agents)
        found = np.asarray(given)
        if what == "reward" and found.shape == (games,):
            found = found[:, None]
        is_number = found.dtype.kind in "biuf"
        wanted = [(games, agents)] + [(games, 1)] * (what == "reward")
        if found.shape[:2] not in wanted or not is_number or (what == "reward" and found.ndim > 2):
            raise BadValue(
                f"{what} must give numbers for {games} games and {agents} agents, an array ({games}, {agents}"
                f"{'' if what == 'reward' else ', …'}), not {found.dtype} of the shape {found.shape}."
            )
        return found

    def _refuse_no_numbers(self, rewards: FloatArray) -> None:
        """Refuse rewards that are not finite, for agents that took part."""
        wrong = ~np.isfinite(rewards)
        if wrong.any():
            game, agent = np.argwhere(wrong)[0].tolist()
            raise BadValue(
                f"reward must give finite numbers, not {rewards[game, agent]} for agent {self.names[agent]!r} in game "
                f"{game}."
            )


def combine_runs(of_env: int, of_learner: int) -> int:
    """Return the run of an environment and a learner that have seeds; an environment with the seed 0 has none."""
    return kernels.compute_run_seeds([of_env], [of_learner], [0])[0] if of_env not in (0, of_learner) else of_learner


class EdgeTable:
    """The legal edges of agents that move along one edge per turn, and the moves to their ends, on the first map.

    Args:
        views: a view of the games on each map.
    """

    def __init__(self, views: Sequence[ArrayView]) -> None:
        self._first = np.cumsum([0, *(view.streets.num_nodes for view in views)])  # the place of each map's first node
        each = [_list_edges(view) for view in views]
        self._offsets = np.cumsum([0, *chain.from_iterable(counts.tolist() for counts, _, _ in each)])
        self._ids, self._moves = (np.append(np.concatenate([one[i] for one in each]), -1) for i in (1, 2))

    def count(self, maps: IntArray, nodes: IntArray) -> IntArray:
        """Return the number of edges from nodes, (games, agents), on the maps of games, (games,)."""
        places = self._first[maps][:, None] + nodes
        found: IntArray = self._offsets[places + 1] - self._offsets[places]
        return found

    def find(self, maps: IntArray, nodes: IntArray, numbers: IntArray) -> tuple[IntArray, IntArray]:
        """Return the ids of edges, -1 for none, and the numbers of the legal nodes at their ends, (games, agents) each.

        Args:
            maps: (games,) the maps of the games.
            nodes: (games, agents) the nodes.
            numbers: (games, agents) legal numbers of edges from these nodes, from 1; 0 for none.
        """
        at = np.where(numbers > 0, self._offsets[self._first[maps][:, None] + nodes] + numbers - 1, -1)
        return self._ids[at], np.maximum(self._moves[at], 0)


def _list_edges(view: ArrayView) -> tuple[IntArray, IntArray, IntArray]:
    """Return how many edges leave each node of a map, their ids, and the numbers of their ends among legal nodes."""
    movement = get_movement(view)
    columns = movement.columns
    streets = view.streets
    nodes = streets.num_nodes
    offsets, edges = movement.all_roads.edges_at_start[0]
    edges = edges[: offsets[nodes]]
    edges = edges[columns.sources[edges] != columns.targets[edges]]
    edges = edges[np.lexsort((columns.edge_ids[edges], columns.sources[edges]))]
    sources = columns.sources[edges]
    keys = np.repeat(np.arange(nodes), streets.counts) * nodes + streets.targets
    order = np.argsort(keys)
    places = order[np.searchsorted(keys[order], sources * nodes + columns.targets[edges])]
    counts = np.bincount(sources, minlength=nodes)
    return counts, columns.edge_ids[edges], places - streets.offsets[sources]


def count_edge_actions(view: ArrayView) -> int:
    """Return the number of actions that take edges on the map of a view, with that to stay.

    Raises:
        BadValue: there are more than 4096.
    """
    movement = get_movement(view)
    columns = movement.whole.columns
    leaves = columns.sources != columns.targets
    most = int(np.bincount(columns.sources[leaves], minlength=1).max())
    most = 1 + max(most, _EDGES_AROUND if movement.by_metres else 0)
    if most > _MOST_ACTIONS:
        raise BadValue(f"An agent may take {most - 1} edges from a node, and {_MOST_ACTIONS} actions are the most.")
    return most


def join_by_agents(columns: Sequence[Any]) -> Any:
    """Concatenate arrays (games, agents, …) by agents; return a single one unchanged."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns, axis=1)


def _join_in_order(parts: Sequence[Any], views: Sequence[ArrayView]) -> Any:
    """Return arrays (games of the view, …) as one array in the order of the games."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts)[np.argsort(np.concatenate([view.games for view in views]))]


def _restrict_views(views: Sequence[ArrayView], which: IntArray) -> list[ArrayView]:
    """Return the views restricted to some games, ascending, without empty views."""
    found = [(view, np.flatnonzero(np.isin(view.games, which))) for view in views]
    return [view.in_games(places) for view, places in found if len(places)]


def limit_to_reach(flights: FloatArray, reach_m: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return flights (games, agents, 3), given as shares of the agents' reach, in map units.

    A flight longer than 1 is shortened to 1; one that is not finite hovers.
    """
    if flights.shape != (*shape, 3) or flights.dtype.kind not in "iuf":
        raise BadValue(
            f"Flights are numbers (east, north, up), an array {(*shape, 3)}, not {flights.dtype} of the shape "
            f"{flights.shape}."
        )
    finite = np.where(np.isfinite(flights).all(axis=2, keepdims=True), flights, 0.0).astype(np.float64)
    length = np.maximum(np.sqrt((finite * finite).sum(axis=2, keepdims=True)), 1.0)
    found: FloatArray = finite / length * reach_m[:, None]
    return found


def check_range(numbers: IntArray, count: int | IntArray, names: Sequence[str]) -> None:
    """Refuse actions of the named agents, (games, agents, …), with numbers that are not from 0 to `count - 1`.

    Raises:
        BadValue: a number is smaller or larger.
    """
    wrong = (numbers < 0) | (numbers >= count)
    if wrong.any():
        game, agent, *_ = np.argwhere(wrong)[0].tolist()
        raise BadValue(
            f"Action {numbers[game, agent]} of agent {shown(names[agent])} in game {game} is not in the action space, "
            f"of numbers from 0 to {count - 1}: illegal actions in it count as 0, and others are refused."
        )


def are_in(masks: BoolArray, chosen: ActionArray) -> BoolArray:
    """Return whether numbers, of any shape, are legal by masks with one more axis."""
    known = np.clip(chosen, 0, masks.shape[-1] - 1)
    found: BoolArray = (known == chosen) & np.take_along_axis(masks, known[..., None], axis=-1)[..., 0]
    return found


def _count_public_agents(view: ArrayView) -> int:
    """Return how many agents of a game callers may know of."""
    return int(np.count_nonzero(view.roster.is_public))


def default_observation(view: ArrayView, threads: int = 1) -> Float32Array:
    """Return the default observation: (games, agents, entries).

    The entries are those of `ArrayView.vector` with up to 8 other agents; for each deed that lasts, the share that the
    agent has done of it; `z`, if an agent of the game flies; and last `turn`: the share n / (n + 100) after n turns.

    Args:
        view: the view of the agents.
        threads: the number of threads; the result does not depend on it.
    """
    return _make_default_vectors(view, threads).values


def straight_observation(view: ArrayView) -> Float32Array:
    """Return the default observation without its distances by road, as environments of earlier versions gave it.

    Policies that were saved with those environments play by it.

    Args:
        view: the view of the agents.
    """
    found = _make_default_vectors(view, 1)
    roads = [number for number, name in enumerate(found.names) if name.endswith(".road")]
    return np.delete(found.values, roads, axis=2)


def _make_default_vectors(view: ArrayView, threads: int) -> ObservationVectors:
    """Return the vectors of `default_observation`, with the names of the first entries."""
    has_z = any(agent.type is AgentType.AERIAL for agent in view.roster.agents)
    lasting = list_lasting_deeds(view)
    found = encode_vectors(view, min(_count_public_agents(view) - 1, _MOST_OTHERS), 1 + has_z + len(lasting), threads)
    if lasting:
        doing = view["doing"]
        first = found.values.shape[2] - 1 - has_z - len(lasting)
        for number, (kind, turns) in enumerate(lasting):
            found.values[..., first + number] = np.where(doing.kind == kind, 1.0 - doing.left / turns, 0.0)
    if has_z:
        z = view["z"] * (2.0 / _measure_longer_side(view.streets.columns.xy))
        found.values[..., -2] = np.where(view.mask, z, 0.0)
        found.values.clip(-2.0, 2.0, out=found.values)
    return found


def _measure_longer_side(xy: FloatArray) -> float:
    """Return the longer side of the bounding box of nodes; 2 if it is 0."""
    return float((xy.max(axis=0) - xy.min(axis=0)).max()) or 2.0


for _function in (default_observation, straight_observation):  # attributes that other observations may have
    _function.bounds = (-2.0, 2.0)  # type: ignore[attr-defined]
    _function.of_each = True  # type: ignore[attr-defined] # the numbers of an agent do not depend on others


def _may_bring_back(rule: object) -> bool:
    """Return whether a rule declares that it brings agents back, or a user's code calls `respawn`."""
    own = (code for code in _list_codes(rule, set()) if not code.co_filename.startswith(_GAMMS))
    return get_rule_spec(rule).brings_back or any("respawn" in code.co_names for code in own)


def _may_give_scores(rule: object) -> bool:
    """Return whether a rule declares that it uses scores, or code that it can reach does."""
    return get_rule_spec(rule).uses_scores or any("scores" in code.co_names for code in _list_codes(rule, set()))


def _list_codes(value: object, seen: set[int]) -> Iterator[CodeType]:
    """Yield the code of a function or of an object's methods, and of all functions that it can reach."""
    if id(value) in seen or isinstance(value, type | ModuleType):
        return
    seen.add(id(value))
    if isinstance(value, partial):
        yield from _list_codes(value.func, seen)
        return
    if not isinstance(value, FunctionType):
        attributes = chain.from_iterable(vars(kind).values() for kind in type(value).__mro__)
        methods = (one for one in attributes if isinstance(one, FunctionType))
        for method in methods:
            yield from _list_codes(method, seen)
        return
    yield from _list_inner_codes(value.__code__)
    for cell in value.__closure__ or ():
        with suppress(ValueError):  # it has no value yet
            yield from _list_codes(cell.cell_contents, seen)
    for name in value.__code__.co_names:
        if isinstance(value.__globals__.get(name), FunctionType):
            yield from _list_codes(value.__globals__[name], seen)


def _list_inner_codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _list_inner_codes(constant)
