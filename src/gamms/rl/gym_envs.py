"""The environments of Gymnasium: one learning agent, and many games at once."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gamms.arguments import as_int, as_items
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.heads import are_legal, refuse_mixed
from gamms.rl.interface import (
    METADATA,
    Columns,
    CopyableEnv,
    EnvInterface,
    RenderMode,
    make_mask_infos,
    make_metadata,
    prepare,
    render_first_game,
)
from gamms.rl.learners import ActionArray, Begins, Seeds
from gamms.scenario import Scenario
from gamms.text import shown

Infos = dict[str, Any]
_BEGINS: dict[AutoresetMode, Begins] = {
    AutoresetMode.SAME_STEP: "ended",
    AutoresetMode.NEXT_STEP: "waiting",
    AutoresetMode.DISABLED: None,
}
Observed = Any  # `observation` and `action_mask`, or the observation alone


class AgentEnv(CopyableEnv, gymnasium.Env[Observed, Any]):
    """One learning agent in one game; made by `gamms.rl.single_agent_env`.

    Args:
        interface: the interface of learners in one game, in a context; only the first agent is used.
        name: the name of the scenario.
        render_mode: "human", "rgb_array" or None.
    """

    metadata = METADATA
    _own = "spec", "observation_space", "action_space"

    def __init__(self, interface: EnvInterface, name: str, render_mode: RenderMode) -> None:
        self.metadata = make_metadata(name)
        self._interface = interface
        self.render_mode = render_mode
        self.learners = interface.learners
        prepare(self.learners, render_mode)
        self.observation_space = interface.make_observation_space()
        self.action_space = interface.make_action_space()

    def reset(self, *, seed: Seeds = None, options: dict[str, Any] | None = None) -> tuple[Observed, Infos]:
        """Reset the game.

        Args:
            seed: the seed of a run, whose first game begins; or a list with the seed of the game itself, as in
                `Scenario.play`; None: the next game of the run.
            options: ignored.
        """
        super().reset(seed=None if isinstance(seed, Iterable) else seed, options=options)
        self.learners.begin_all(seed)
        found = self._list_columns()
        return self._interface.convert(found), make_mask_infos(found) | self._list_drawn()

    def step(self, action: Any) -> tuple[Observed, float, bool, bool, Infos]:
        """Play a turn; after an illegal action the agent stays, and `info["is_legal"]` is False."""
        heads = self._interface.decode_heads([(np.array([0]), action)])
        was_legal = bool(are_legal(self.learners, heads)[0, 0])
        played = self.learners.step(*heads)
        found = self._list_columns()
        infos = {**make_mask_infos(found), **self._list_drawn(), "is_legal": was_legal}
        is_out = bool(played.terminated[0, 0])
        is_late = bool(played.truncated[0, 0])
        return self._interface.convert(found), float(played.rewards[0, 0]), is_out, is_late, infos

    def action_masks(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return a mask of legal actions, (actions,), for `sb3_contrib.MaskablePPO`."""
        masks: np.ndarray[Any, np.dtype[np.bool_]] = self._interface.compute_masks()[0, 0]
        return masks

    def render(self) -> Any:
        """Return a picture, (height, width, 3), or show it in the window; do nothing without a render mode."""
        return render_first_game(self.learners, self.render_mode)

    def close(self) -> None:
        """Close the game."""
        self.learners.close()

    def _list_drawn(self) -> Infos:
        return {key: column[0] for key, column in self.learners.drawn.items()}

    def _list_columns(self) -> Columns:
        return {key: column[0, 0] for key, column in self._interface.collect_columns().items()}


class SlotsTurn(NamedTuple):
    """The results of a turn for all slots.

    Attributes:
        now: the observations after the turn and after games were reset.
        last: the observations before games were reset.
        rewards: (slots,)
        terminated: (slots,)
        truncated: (slots,)
        valid: (slots,) whether the slot's agent took part in the turn.
    """

    now: Columns
    last: Columns
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    valid: BoolArray


class GamesEnv(CopyableEnv, VectorEnv[Observed, ActionArray, Any]):
    """Many games at once, with a slot for each game and learning agent; made by `gamms.rl.vector_env`.

    Slot `game * agents + agent`. The slots of a game are reset together. A slot is `terminated` when its agent goes
    out, and not again when its game ends: until the game is reset, the slot waits. While it waits its reward is 0, its
    only legal action is to stay, and `infos["valid"]` is False. When a slot is terminated or truncated, `infos["life"]`
    has the sum of its rewards, `r`, and the number of turns in which its agent took part, `l`; `infos["_life"]` says
    which slots have ended. (An episode in the sense of Gymnasium's wrappers includes the turns for which a slot waits.)

    Args:
        interface: the interface of learners in the games.
        name: the name of the scenario.
        autoreset_mode: when a finished game is reset: in its last step, which reports `infos["final_obs"]` and
            `infos["final_info"]`; in the next step, whose actions do not count; or only by `reset`.
        render_mode: "human", "rgb_array" or None.
        num_games: the number of games; None: that of the learners.

    Attributes:
        learners: see above.
        num_games: the number of games.
        num_agents: the number of learning agents in each game.
    """

    _own = (
        *("spec", "observation_space", "action_space", "single_observation_space", "single_action_space"),
        *("_returns", "_lengths"),
    )

    def __init__(
        self,
        interface: EnvInterface,
        name: str,
        autoreset_mode: AutoresetMode,
        render_mode: RenderMode,
        num_games: int | None = None,
    ) -> None:
        self._interface = interface
        self._autoreset_mode = autoreset_mode
        self.metadata = {**make_metadata(name), "autoreset_mode": autoreset_mode}
        self.render_mode = render_mode
        learners = interface.learners
        self.learners = learners
        self.num_agents = len(learners.names)
        self._everyone = np.arange(self.num_agents)
        self.num_games = len(learners.games) if num_games is None else num_games
        self.num_envs = self.num_games * self.num_agents
        self._returns: FloatArray = np.zeros(self.num_envs)  # of the lives so far
        self._lengths: IntArray = np.zeros(self.num_envs, np.int64)
        refuse_mixed(learners, range(self.num_agents), "vector_env")
        self.single_observation_space = interface.make_observation_space()
        self.single_action_space = interface.make_action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Observed, Infos]:
        """Reset games, at first to those of a run, and later to the next ones; see `Learners.begin_from`.

        Args:
            seed: the seed of a run; or a list with the seed of each game itself, or of each slot, with equal seeds for
                the slots of a game. None, also in the list: the next game of the run.
            options: `{"reset_mask": booleans (slots,)}` resets only the games whose agents still playing are all
                named. In other games, the slots of agents that are out keep waiting. Other options are ignored.

        Raises:
            BadType, BadValue: the seeds or the mask have another form; or the mask names only some of the agents that
                still play in a game.
        """
        seeds = self._list_seeds(seed)
        which = np.arange(self.num_games)
        if options is not None and "reset_mask" in options:
            which = self._find_games(options["reset_mask"])
        found, alive = self._begin(which, seeds)
        is_other = np.ones(self.num_games, np.bool_)
        is_other[which] = False
        self._go_on_with(np.repeat(is_other, self.num_agents))
        return self._interface.convert(found), _make_infos(found, alive) | self._list_drawn()

    def step(self, actions: ActionArray) -> tuple[Observed, Any, Any, Any, Infos]:
        """Play a turn of all games, and reset finished games as `autoreset_mode` says.

        Args:
            actions: (slots,) indices of legal nodes, or with deeds (slots, 2); after an illegal one the agent stays.
                For flying agents, (slots, 3) and more: see `heads`.

        Raises:
            BadValue: these are not actions; or a game has ended that only `reset` may reset.
        """
        if self._autoreset_mode is AutoresetMode.DISABLED and self._find_ended_games().any():
            raise BadValue(
                f"Game {int(self._find_ended_games().argmax())} has ended: call reset(options={{'reset_mask': "
                "terminated | truncated}) before step()."
            )
        drawn = self._list_drawn()
        turn = self._play(actions)
        ends = turn.terminated | turn.truncated
        infos = Infos()
        if self._autoreset_mode is AutoresetMode.SAME_STEP and ends.any():
            final = _make_infos(turn.last, turn.valid) | drawn
            infos = {"final_obs": self._interface.convert(turn.last), "final_info": final}
            infos |= {"_final_obs": ends, "_final_info": ends.copy()}
        infos |= self._note_lives(turn, ends)
        infos |= _make_infos(turn.now, turn.valid) | self._list_drawn()
        return self._interface.convert(turn.now), turn.rewards, turn.terminated, turn.truncated, infos

    def _note_lives(self, turn: SlotsTurn, ends: BoolArray) -> Infos:
        """Add a turn to the lives of agents; return the infos of those that end, (slots,)."""
        self._returns = self._returns + turn.rewards
        self._lengths = self._lengths + turn.valid
        if not ends.any():
            return {}
        life = {"r": np.where(ends, self._returns, 0.0), "l": np.where(ends, self._lengths, 0)}
        self._go_on_with(~ends)
        return {"life": life, "_life": ends.copy()}

    def _go_on_with(self, going: BoolArray) -> None:
        """Begin new lives of slots, except of those that go on, (slots,)."""
        self._returns = self._returns * going
        self._lengths = self._lengths * going

    def action_masks(self) -> BoolArray:
        """Return a mask of legal actions, (slots, actions)."""
        return self._interface.compute_masks().reshape(self.num_envs, -1)

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture for each slot, (height, width, 3), or show game 0 in its window.

        Only game 0 is rendered: the pictures of the slots of other games are black. Without a render mode, log a
        warning and return None.
        """
        picture = self._render_game()
        if picture is None:
            return None
        black = np.zeros_like(picture)
        return (picture,) * self.num_agents + (black,) * (self.num_envs - self.num_agents)

    def close_extras(self, **_: object) -> None:
        """Close the games."""
        self.learners.close()

    # -- inside: methods that `ProcessesEnv` overrides ----------------------------------------------------------

    def _list_drawn(self) -> Infos:
        """Return what the games play with, (slots,); see `Learners.drawn`."""
        return {key: np.repeat(column, self.num_agents) for key, column in self.learners.drawn.items()}

    def _begin(self, which: IntArray, seeds: Seeds) -> tuple[Columns, BoolArray]:
        """Reset games, by their numbers; return the observations, and whether agents are alive, (slots,)."""
        if seeds is not None:
            self.learners.begin_from(seeds, which)
        self.learners.begin_again(which)
        return self._flatten_columns(self._interface.collect_columns()), self.learners.alive.ravel()

    def _play(self, actions: ActionArray) -> SlotsTurn:
        """Play a turn."""
        learners = self.learners
        mode = self._autoreset_mode
        was_over = learners.is_over if mode is AutoresetMode.NEXT_STEP else None
        heads = self._interface.decode_heads([(self._everyone, actions)])
        played = learners.step(*heads, begins=_BEGINS[mode])
        begun = learners.begun
        if was_over is not None:
            was_over[begun] = False
            if was_over.any():
                learners.begin_again(np.flatnonzero(was_over))
        now = self._flatten_columns(self._interface.collect_columns())
        last = now
        num_over = np.count_nonzero(learners.is_over)
        if mode is AutoresetMode.SAME_STEP and (played.num_ended or len(begun) or num_over):
            last = {key: column.copy() for key, column in now.items()}
            if len(begun):
                self._put(last, begun, self._interface.get_ended_columns())
        if mode is AutoresetMode.SAME_STEP and num_over:
            now = {key: column.copy() for key, column in now.items()}
            ended = np.flatnonzero(learners.is_over)
            learners.begin_again(ended)
            self._put(now, ended, self._interface.collect_columns(ended))
        return SlotsTurn(
            now,
            last,
            played.rewards.reshape(-1),
            played.terminated.reshape(-1),
            played.truncated.reshape(-1),
            played.valid.reshape(-1),
        )

    def _put(self, columns: Columns, games: IntArray, rows: Columns) -> None:
        """Write the rows of some games into columns of all slots."""
        for key, of_games in rows.items():
            columns[key].reshape(self.num_games, self.num_agents, *of_games.shape[2:])[games] = of_games

    def _render_game(self) -> Any:
        """Return a picture of game 0, or show it in its window."""
        return render_first_game(self.learners, self.render_mode)

    def _find_ended_games(self) -> BoolArray:
        """Return whether games have ended, (games,)."""
        over: BoolArray = self.learners.is_over
        return over

    def _find_playing_agents(self) -> BoolArray:
        """Return whether agents still play, (games, agents)."""
        learners = self.learners
        plays: BoolArray = (learners.alive | (learners.is_there & learners.may_return)) & ~learners.is_over[:, None]
        return plays

    # -- inside -------------------------------------------------------------------------------------------------

    def _list_seeds(self, seed: object) -> Seeds:
        """Return a single seed for all games, or a list with one for each."""
        if seed is None or isinstance(seed, int | np.integer):
            return None if seed is None else as_int(seed, "seed")
        given = [None if one is None else as_int(one, "seed") for one in as_items(seed, "seed", "seeds")]
        if len(given) == self.num_games:
            return given
        if len(given) != self.num_envs:
            raise BadValue(
                f"seed has {len(given)} seeds, and there are {self.num_games} games and {self.num_envs} slots: give "
                "one integer, or one for each game or slot."
            )
        of_games = [given[first : first + self.num_agents] for first in range(0, self.num_envs, self.num_agents)]
        for game, seeds in enumerate(of_games):
            if len({*seeds}) > 1:
                raise BadValue(
                    f"The slots of game {game} have the seeds {shown(seeds)}, and a game has one: give one seed for "
                    "each game, or the same one for its slots."
                )
        return [seeds[0] for seeds in of_games]

    def _find_games(self, given: object) -> IntArray:
        """Return the numbers of the games that a mask of slots resets."""
        mask = given
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise BadType(f"options['reset_mask'] must be an array of NumPy of booleans, not {shown(given)}.")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise BadValue(
                f"options['reset_mask'] must name at least one of {self.num_envs} slots, in the shape "
                f"({self.num_envs},), not {shown(given)}."
            )
        named = mask.reshape(self.num_games, self.num_agents)
        plays = self._find_playing_agents()
        goes_on = (plays & ~named).any(axis=1)
        torn = goes_on & (plays & named).any(axis=1)
        if torn.any():
            raise BadValue(
                f"options['reset_mask'] names some slots of game {int(torn.argmax())}, which begin together: name all "
                "of its agents that play, or none."
            )
        return np.flatnonzero(named.any(axis=1) & ~goes_on)

    def _flatten_columns(self, found: Columns) -> Columns:
        return {key: column.reshape(self.num_envs, *column.shape[2:]) for key, column in found.items()}


def _make_infos(found: Columns, valid: BoolArray) -> Infos:
    """Return the infos of all slots, with the masks of their observations."""
    return {**{key: mask > 0 for key, mask in make_mask_infos(found).items()}, "valid": valid.copy()}


def parse_mode(given: object) -> AutoresetMode:
    """Return a mode from the mode itself or its name.

    Raises:
        BadValue: the mode does not exist.
    """
    known: dict[object, AutoresetMode] = {}
    for mode in AutoresetMode:
        known.update(dict.fromkeys((mode, mode.name, mode.value), mode))
    try:
        return known[given]
    except (KeyError, TypeError):
        names = [mode.name for mode in AutoresetMode]
        raise BadValue(f"autoreset_mode must be one of {names}, not {shown(given)}.") from None


def make_spec(make: Callable[..., Any], scenario: Scenario, options: dict[str, Any]) -> EnvSpec:
    """Return the spec by which Gymnasium can make the environment again with another render mode."""
    name = "".join(word for word in scenario.spec.name.title() if word.isalnum()) or "Game"
    return EnvSpec(f"gamms/{name}-v0", entry_point=partial(make, scenario), kwargs=options)
