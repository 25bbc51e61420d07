"""Many games at once in several processes: each plays a share of them, and all arrays are in shared memory.

The processes are those of `gamms.workers`. The arrays are in a file that is mapped into all of them. Its name is
removed once they have opened it, so that nothing remains of it, whatever happens to them.
"""

import mmap
import os
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from shutil import disk_usage
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode

from gamms.errors import BadType, BadValue
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.gym_envs import GamesEnv, SlotsTurn
from gamms.rl.interface import Columns, EnvInterface, RenderMode
from gamms.rl.learners import ActionArray, Seeds
from gamms.workers import Worker, WorkerDied, make_task

Arrays = dict[str, np.ndarray[Any, Any]]
_KEYS = "observation", "action_mask"
_OF_SLOTS = "rewards", "terminated", "truncated", "valid"  # fields of a `SlotsTurn`
_MEMORY = "/dev/shm"  # noqa: S108 - where Linux has files in memory; ours have names of `mkstemp`
_LINE = 64  # bytes at which arrays are aligned
_OBSERVED = "observed "  # prefixes of the names of observations: current, and at the end of a game
_LAST = "observed last "


class SharedColumn(NamedTuple):
    """The layout of an array over all slots."""

    name: str
    shape: tuple[int, ...]
    kind: str  # NumPy's code for the type of its numbers


class ProcessesEnv(GamesEnv):
    """The games of `GamesEnv` in several processes, each with a share of them; made by `gamms.rl.vector_env`.

    Args:
        interface: the interface of learners in a game that is not played, for the spaces.
        name: the name of the scenario.
        autoreset_mode: see `GamesEnv`.
        render_mode: see `GamesEnv`; the first process renders game 0.
        num_games: the number of games.
        seed: the seed of the run.
        workers: the number of processes, at most one for each game.
        make: returns an environment of `num_games=` games of the run `seed=`.
    """

    def __init__(
        self,
        interface: EnvInterface,
        name: str,
        autoreset_mode: AutoresetMode,
        render_mode: RenderMode,
        *,
        num_games: int,
        seed: int,
        workers: int,
        make: Callable[..., GamesEnv],
    ) -> None:
        self._workers: list[Worker] = []
        self._file: Path | None = None
        self._drawn_in: list[Arrays] = [{}]  # of each process, see `Learners.drawn`
        super().__init__(interface, name, autoreset_mode, render_mode, num_games)
        self._first = np.linspace(0, num_games, workers + 1).astype(int).tolist()  # first game of each process
        columns = self._list_columns()
        file = _make_file(_count_bytes(columns))
        self._file = file
        try:
            self._memory = _map_file(file, columns)
            shares = pairwise(self._first)
            tasks = [self._make_first_task(file, columns, share, seed, make) for share in shares]
            self._workers = [Worker() for _ in tasks]
            self._ask(tasks)
        except BaseException:
            self.close()
            raise
        self._unlink()

    def action_masks(self) -> BoolArray:
        """Return a mask of legal actions, (slots, actions)."""
        key = f"{_OBSERVED}action_mask"
        return self._arrays[key] > 0 if key in self._arrays else self._interface.compute_masks()

    def set_others(self, others: Mapping[str, Any] | None) -> None:
        """Replace the strategies of other agents and teams in all processes; see `GamesEnv.set_others`."""
        self._refuse_closed()
        task = _pickle_task(set_others, others)
        super().set_others(others)  # of the game that is not played, which refuses wrong ones
        self._drawn_in = self._ask([task] * len(self._workers))

    def _list_drawn(self) -> dict[str, Any]:
        """Return what the games have drawn by their seeds, (slots,), as their processes said last."""
        keys = self._drawn_in[0]
        return {key: np.repeat(np.concatenate([one[key] for one in self._drawn_in]), self.num_agents) for key in keys}

    def _begin(self, which: IntArray, seeds: Seeds) -> tuple[Columns, BoolArray]:
        """Begin games; see `GamesEnv`."""
        tasks = []
        for first, last in pairwise(self._first):
            games = which[(which >= first) & (which < last)] - first
            of_games = seeds[first:last] if isinstance(seeds, Sequence) else seeds
            tasks.append(_pickle_task(begin_games, games, of_games))
        self._drawn_in = self._ask(tasks)
        self.learners.has_begun = True
        return self._get_observations(_OBSERVED), self._arrays["valid"].copy()

    def _play(self, actions: ActionArray) -> SlotsTurn:
        """Play a turn; see `GamesEnv`."""
        given = self._interface.as_actions(self.num_games, np.arange(self.num_agents), actions)
        taken = self._arrays["actions"]
        taken[:] = given.reshape(taken.shape)
        self._drawn_in = self._ask([_STEP] * len(self._workers))
        of_slots = (self._arrays[name].copy() for name in _OF_SLOTS)
        return SlotsTurn(self._get_observations(_OBSERVED), self._get_observations(_LAST), *of_slots)

    def _get_checkpoint(self) -> list[Any]:
        """Return checkpoints of the games of each process."""
        return self._ask([_pickle_task(carried) for _ in self._workers])

    def _restore(self, carried: list[Any]) -> None:
        """Make each process replay its games up to a checkpoint."""
        self._drawn_in = self._ask([_pickle_task(restore, one) for one in carried])
        self.learners.has_begun = carried[0].seeds is not None

    def _render_game(self) -> Any:
        """Render game 0 in its process; see `GamesEnv`."""
        if self.render_mode is None:
            return super()._render_game()
        return self._ask([_pickle_task(render)])[0]

    def _find_ended_games(self) -> BoolArray:
        over: BoolArray = self._arrays["over"][:: self.num_agents]
        return over

    def _find_playing_agents(self) -> BoolArray:
        plays: BoolArray = self._arrays["plays"].reshape(self.num_games, self.num_agents)
        return plays

    def close_extras(self, **_: object) -> None:
        """Close the games and end the processes."""
        for worker in self._workers:
            worker.end()
        self._workers = []
        self._memory = {}
        self._unlink()
        self.learners.close()

    def _unlink(self) -> None:
        with suppress(OSError):  # on Windows the file keeps its name while it is used
            if self._file is not None:
                self._file.unlink(missing_ok=True)

    def _make_first_task(
        self,
        file: Path,
        columns: Sequence[SharedColumn],
        share: tuple[int, int],
        seed: int,
        make: Callable[..., GamesEnv],
    ) -> bytes:
        first, last = share
        agents = self.num_agents
        mode = self.render_mode if first == 0 else None
        share_of_games = partial(make, num_games=last - first, seed=seed, render_mode=mode)
        return _pickle_task(begin, file, columns, slice(first * agents, last * agents), first, share_of_games)

    def _get_observations(self, prefix: str) -> Columns:
        return {key: self._arrays[prefix + key].copy() for key in _KEYS if prefix + key in self._arrays}

    def _list_columns(self) -> list[SharedColumn]:
        slots = (self.num_envs,)
        actions = slots + (self.single_action_space.shape or ())
        kind = "f8" if self.learners.any_fly else "i8"
        found = [SharedColumn("actions", actions, kind), SharedColumn("rewards", slots, "f8")]
        found += [SharedColumn(name, slots, "?") for name in (*_OF_SLOTS[1:], "over", "plays")]
        return found + [
            SharedColumn(prefix + key, slots + column.shape[2:], column.dtype.str)
            for prefix, (key, column) in product((_OBSERVED, _LAST), self._interface.collect_columns().items())
        ]

    def _ask(self, tasks: Sequence[bytes]) -> list[Any]:
        """Run a task in each process, all at once, and return their results; the tasks also write shared arrays.

        Raises:
            BadValue: the environment is closed.
            WorkerDied: a process has ended, which closes the environment.
            Exception: an error in a process, which closes the environment as well.
        """
        self._refuse_closed()
        try:
            for number, task in enumerate(tasks):
                self._call_on_process(number, Worker.send, task)
            answers = [self._call_on_process(number, Worker.receive)[1] for number in range(len(tasks))]
        except BaseException:
            self.close()  # also after Ctrl-C: late answers would be taken for those of the next turn
            raise
        for number, answer in enumerate(answers):
            if isinstance(answer, Exception):
                self.close()
                answer.add_note(f"{self._describe_process(number)}; the environment was closed.")
                raise answer
        return answers

    def _call_on_process(self, number: int, call: Callable[..., Any], *given: object) -> Any:
        try:
            return call(self._workers[number], *given)
        except WorkerDied as error:
            raise WorkerDied(f"{self._describe_process(number)}: {error}") from None

    @property
    def _arrays(self) -> Arrays:
        """The shared arrays over all slots."""
        self._refuse_closed()
        return self._memory

    def _refuse_closed(self) -> None:
        if not self._workers:
            raise BadValue("This environment is closed: make another one with gamms.rl.vector_env.")

    def _describe_process(self, number: int) -> str:
        first, last = self._first[number : number + 2]
        return f"In process {number + 1} of {len(self._first) - 1}, which plays the games {first} to {last - 1}"


class _WorkerGames:
    """The games that a process plays.

    Args:
        games: the environment of these games.
        arrays: the parts of the shared arrays for their slots.
    """

    def __init__(self, games: GamesEnv, arrays: Arrays) -> None:
        self._games = games
        self._arrays = arrays

    def begin(self, which: IntArray, seeds: Seeds) -> Arrays:
        observed, self._arrays["valid"][:] = self._games._begin(which, seeds)
        self._write(_OBSERVED, observed)
        return self._finish()

    def set_others(self, others: Mapping[str, Any] | None) -> Arrays:
        self._games.set_others(others)
        return self._finish()

    def carried(self) -> Any:
        return self._games._get_checkpoint()

    def restore(self, carried: object) -> Arrays:
        games = self._games
        games._restore(carried)
        self._write(_OBSERVED, games._flatten_columns(games._interface.collect_columns()))
        return self._finish()

    def render(self) -> Any:
        return self._games._render_game()

    def step(self) -> Arrays:
        turn = self._games._play(self._arrays["actions"])
        self._write(_OBSERVED, turn.now)
        self._write(_LAST, turn.last)
        for name in _OF_SLOTS:
            self._arrays[name][:] = getattr(turn, name)
        return self._finish()

    def _finish(self) -> Arrays:
        """Write which games and agents still play; return what the games have drawn."""
        self._arrays["over"][:] = np.repeat(self._games._find_ended_games(), self._games.num_agents)
        self._arrays["plays"][:] = self._games._find_playing_agents().ravel()
        drawn: Arrays = self._games.learners.drawn
        return drawn

    def _write(self, prefix: str, observed: Columns) -> None:
        for key, column in observed.items():
            self._arrays[prefix + key][:] = column


_games_here: _WorkerGames | None = None  # in a worker process


def begin(
    file: Path, columns: Sequence[SharedColumn], slots: slice, first_game: int, make: Callable[[], GamesEnv]
) -> None:
    """Create the games of some slots in this process by `make`; see `Learners.first_game`."""
    global _games_here  # noqa: PLW0603 - a process plays in one environment
    games = make()
    arrays = _map_file(file, columns)
    games.learners.first_game = first_game
    _games_here = _WorkerGames(games, {name: array[slots] for name, array in arrays.items()})


def begin_games(which: IntArray, seeds: Seeds) -> Arrays:
    """Begin games of this process, by their numbers in it; return what all have drawn, see `Learners`."""
    return {} if _games_here is None else _games_here.begin(which, seeds)


def set_others(others: Mapping[str, Any] | None) -> Arrays:
    """Replace the strategies of other agents and teams in the games of this process; return their draws."""
    if _games_here is None:
        return {}
    return _games_here.set_others(others)


def carried() -> Any:
    """Return a checkpoint of the games of this process; see `Learners.carried`."""
    return None if _games_here is None else _games_here.carried()


def restore(carried: object) -> Arrays:
    """Replay the games of this process up to a checkpoint; return their draws."""
    return {} if _games_here is None else _games_here.restore(carried)


def render() -> Any:
    """Render the first game of this process; see `GamesEnv.render`."""
    return None if _games_here is None else _games_here.render()


def step() -> Arrays:
    """Play a turn of the games of this process; return their draws."""
    return {} if _games_here is None else _games_here.step()


def answer(function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    """Call a function in this process; return its result, or the error that it raises."""
    try:
        return function(*given)
    except Exception as error:  # noqa: BLE001 - raised by the process that has asked
        error.add_note(f"In another process:\n{traceback.format_exc()}")
        return error


def _pickle_task(function: Callable[..., Any], *given: object) -> bytes:
    """Return a call as a task for a process."""
    try:
        return make_task(answer, function, given)
    except Exception as error:
        raise BadType(
            f"vector_env(…, workers=) sends what it is given to other processes, which cannot be done here: {error}. "
            "Give functions that a module defines."
        ) from error


_STEP = _pickle_task(step)


def _make_file(size: int) -> Path:
    """Return a new file of this size, in memory if the system supports it and has enough space."""
    has_space = os.access(_MEMORY, os.W_OK) and disk_usage(_MEMORY).free > 2 * size
    number, name = tempfile.mkstemp(prefix="gamms-", dir=_MEMORY if has_space else None)
    with os.fdopen(number, "r+b") as file:
        file.truncate(size)
    return Path(name)


def _map_file(file: Path, columns: Sequence[SharedColumn]) -> Arrays:
    """Return the arrays in a memory-mapped file."""
    with file.open("r+b") as opened:
        memory = mmap.mmap(opened.fileno(), 0)
        found = Arrays()
        begin_at = 0
    for name, shape, kind in columns:
        number = int(np.prod(shape))
        found[name] = np.frombuffer(memory, kind, number, begin_at).reshape(shape)
        begin_at += _pad_size(found[name].nbytes)
    return found


def _count_bytes(columns: Sequence[SharedColumn]) -> int:
    return sum(_pad_size(int(np.prod(shape)) * np.dtype(kind).itemsize) for _, shape, kind in columns)


def _pad_size(size: int) -> int:
    return -(-size // _LINE) * _LINE
