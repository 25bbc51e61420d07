"""Many games at once in several processes: each plays a share of them, and all arrays are in memory that they share.

The processes are those of `gamms.workers`. The arrays are in a file that is mapped into all of them, and that has no
name any more once they have opened it, so that nothing is left of it whatever happens to them.
"""

import mmap
import os
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from shutil import disk_usage
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue
from gamms.ir.obstacles import BoolArray
from gamms.rl.gym_envs import GamesEnv, Infos, Observed
from gamms.rl.heads import action_masks, as_actions
from gamms.rl.learners import ActionArray, Learners
from gamms.workers import Worker, WorkerDied, task_of

Arrays = dict[str, np.ndarray[Any, Any]]
_KEYS = "observation", "action_mask"
_MEMORY = "/dev/shm"  # noqa: S108 - where Linux has files in memory; ours have names of `mkstemp`
_LINE = 64  # bytes at which arrays begin
_OBSERVED, _LAST = "observed ", "observed last "  # before the names of what was observed, now and at the end of a game


class Column(NamedTuple):
    """An array of all slots."""

    name: str
    shape: tuple[int, ...]
    kind: str  # of its numbers, as NumPy writes it


class ProcessesEnv(GamesEnv):
    """The games of `GamesEnv` in several processes, each with a share of them; made by `gamms.rl.vector_env`.

    Args:
        learners: in a game that is not played: they say what all observe and do.
        name: of the scenario.
        num_games: how many games are played.
        seed: of the first one.
        workers: how many processes play them, at most one for each game.
        make: returns an environment of so many games, `num_games=`, of which the first has the `seed=`.
    """

    def __init__(
        self, learners: Learners, name: str, *, num_games: int, seed: int, workers: int, make: Callable[..., GamesEnv]
    ) -> None:
        self._workers: list[Worker] = []
        self._file: Path | None = None
        super().__init__(learners, name, num_games)
        self._first = np.linspace(0, num_games, workers + 1).astype(int).tolist()  # game of each process
        columns = self._columns()
        file = self._file = _new_file(_size(columns))
        try:
            self._memory = _mapped(file, columns)
            shares = zip(self._first, self._first[1:], strict=False)
            tasks = [self._first_task(file, columns, share, seed, make) for share in shares]
            self._workers = [Worker() for _ in tasks]
            self._ask(tasks)
        except BaseException:
            self.close()
            raise
        self._unlink()

    def reset(self, *, seed: object = None, options: dict[str, Any] | None = None) -> tuple[Observed, Infos]:  # noqa: ARG002 - Gymnasium's signature
        """Begin all games: game i with the seed `seed + i`; see `GamesEnv`."""
        first = None if seed is None else as_int(seed, "seed")
        self._ask([_task(reset, None if first is None else first + game) for game in self._first[:-1]])
        self.learners.has_begun = True
        return self._observed(_OBSERVED), self._infos()

    def step(self, actions: ActionArray) -> tuple[Observed, Any, Any, Any, Infos]:
        """Play a turn of all games, and begin those again that have ended; see `GamesEnv`."""
        given, taken = as_actions(self.learners, self.num_games, np.arange(self.num_agents), actions), self._arrays
        taken["actions"][:] = given.reshape(taken["actions"].shape)
        arrays = self._ask([_STEP] * len(self._workers))
        infos, ends = {}, arrays["ends"].copy()
        if ends.any():
            infos = {"final_obs": self._observed(_LAST), "_final_obs": ends}
        rewards, terminated, truncated = (arrays[name].copy() for name in ("rewards", "terminated", "truncated"))
        return self._observed(_OBSERVED), rewards, terminated, truncated, {**infos, **self._infos()}

    def action_masks(self) -> BoolArray:
        """Return which actions are legal, (slots, actions)."""
        key = f"{_OBSERVED}action_mask"
        return self._arrays[key] > 0 if key in self._arrays else action_masks(self.learners)

    def close_extras(self, **_: object) -> None:
        """End the games and the processes."""
        for worker in self._workers:
            worker.end()
        self._workers, self._memory = [], {}
        self._unlink()
        self.learners.close()

    def _unlink(self) -> None:
        with suppress(OSError):  # on Windows the file has its name for as long as it is used
            if self._file is not None:
                self._file.unlink(missing_ok=True)

    def _first_task(
        self, file: Path, columns: Sequence[Column], share: tuple[int, int], seed: int, make: Callable[..., GamesEnv]
    ) -> bytes:
        (first, last), agents = share, self.num_agents
        share_of_games = partial(make, num_games=last - first, seed=seed + first)
        return _task(begin, file, columns, slice(first * agents, last * agents), self.num_games, share_of_games)

    def _infos(self) -> Infos:
        masks = {} if self.learners.flies.all() else {"action_mask": self.action_masks()}
        return {**masks, "valid": self._arrays["valid"].copy()}

    def _observed(self, prefix: str) -> Observed:
        return {key: self._arrays[prefix + key].copy() for key in _KEYS if prefix + key in self._arrays}

    def _columns(self) -> list[Column]:
        slots, spaces = (self.num_envs,), self.observation_space
        actions = slots + (self.single_action_space.shape or ())
        kind = "f8" if self.learners.flies.any() else "i8"
        found = [Column("actions", actions, kind), Column("rewards", slots, "f8")]
        found += [Column(name, slots, "?") for name in ("terminated", "truncated", "valid", "ends")]
        return found + [
            Column(prefix + key, box.shape, box.dtype.str)
            for prefix in (_OBSERVED, _LAST)
            for key, box in cast("Mapping[str, Any]", spaces).items()
        ]

    def _ask(self, tasks: Sequence[bytes]) -> Arrays:
        """Let each process do a task, all at once, and return the arrays, to which they have written.

        Raises:
            BadValue: the environment is closed.
            WorkerDied: a process has ended; the environment is closed then.
            Exception: what one of them has raised; likewise.
        """
        arrays = self._arrays  # it is open
        try:
            for number, task in enumerate(tasks):
                self._of(number, Worker.send, task)
            errors = [self._of(number, Worker.receive)[1] for number in range(len(tasks))]
        except BaseException:
            self.close()  # after Ctrl-C, too: answers still to come would be taken for those of the next turn
            raise
        for number, error in enumerate(errors):
            if error is not None:
                self.close()
                error.add_note(f"{self._named(number)}; the environment was closed.")
                raise error
        return arrays

    def _of(self, number: int, call: Callable[..., Any], *given: object) -> Any:
        try:
            return call(self._workers[number], *given)
        except WorkerDied as error:
            raise WorkerDied(f"{self._named(number)}: {error}") from None

    @property
    def _arrays(self) -> Arrays:
        """The arrays of all slots."""
        if not self._workers:
            raise BadValue("This environment is closed: make another one with gamms.rl.vector_env.")
        return self._memory

    def _named(self, number: int) -> str:
        first, last = self._first[number : number + 2]
        return f"In process {number + 1} of {len(self._first) - 1}, which plays the games {first} to {last - 1}"


class _Share:
    """The games that a process plays.

    Args:
        games: they.
        arrays: of their slots.
    """

    def __init__(self, games: GamesEnv, arrays: Arrays) -> None:
        self._games, self._arrays = games, arrays

    def reset(self, seed: int | None) -> None:
        observed, infos = self._games.reset(seed=seed)
        self._write(_OBSERVED, observed)
        self._arrays["valid"][:] = infos["valid"]

    def step(self) -> None:
        arrays, games = self._arrays, self._games
        observed, arrays["rewards"][:], arrays["terminated"][:], arrays["truncated"][:], infos = games.step(
            arrays["actions"]
        )
        self._write(_OBSERVED, observed)
        self._write(_LAST, infos.get("final_obs", observed))
        arrays["ends"][:], arrays["valid"][:] = infos.get("_final_obs", False), infos["valid"]

    def _write(self, prefix: str, observed: Observed) -> None:
        for key, column in observed.items():
            self._arrays[prefix + key][:] = column


_here: _Share | None = None  # in a process that plays


def begin(file: Path, columns: Sequence[Column], slots: slice, num_games: int, make: Callable[[], GamesEnv]) -> None:
    """Have the games of some slots in this process, of so many in all; `make` returns them."""
    global _here  # noqa: PLW0603 - a process plays in one environment
    games, arrays = make(), _mapped(file, columns)
    games.learners.stride = num_games
    _here = _Share(games, {name: array[slots] for name, array in arrays.items()})


def reset(seed: int | None) -> None:
    """Begin the games of this process; see `ProcessesEnv.reset`."""
    if _here is not None:
        _here.reset(seed)


def step() -> None:
    """Play a turn of the games of this process."""
    if _here is not None:
        _here.step()


def answer(function: Callable[..., None], given: tuple[Any, ...]) -> Exception | None:
    """Call a function in this process; return what it raises."""
    try:
        function(*given)
    except Exception as error:  # noqa: BLE001 - raised by the process that has asked
        error.add_note(f"In another process:\n{traceback.format_exc()}")
        return error
    return None


def _task(function: Callable[..., None], *given: object) -> bytes:
    """Return a call as a task for a process."""
    try:
        return task_of(answer, function, given)
    except Exception as error:
        raise BadType(
            f"vector_env(…, workers=) sends what it is given to other processes, which cannot be done here: {error}. "
            "Give functions that a module defines."
        ) from error


_STEP = _task(step)


def _new_file(size: int) -> Path:
    """Return a file of so many bytes, in memory where the system has such files and enough of it."""
    has_space = os.access(_MEMORY, os.W_OK) and disk_usage(_MEMORY).free > 2 * size
    number, name = tempfile.mkstemp(prefix="gamms-", dir=_MEMORY if has_space else None)
    with os.fdopen(number, "r+b") as file:
        file.truncate(size)
    return Path(name)


def _mapped(file: Path, columns: Sequence[Column]) -> Arrays:
    """Return the arrays that a file holds."""
    with file.open("r+b") as opened:
        memory, found, begin_at = mmap.mmap(opened.fileno(), 0), Arrays(), 0
    for name, shape, kind in columns:
        number = int(np.prod(shape))
        found[name] = np.frombuffer(memory, kind, number, begin_at).reshape(shape)
        begin_at += _padded(found[name].nbytes)
    return found


def _size(columns: Sequence[Column]) -> int:
    return sum(_padded(int(np.prod(shape)) * np.dtype(kind).itemsize) for _, shape, kind in columns)


def _padded(size: int) -> int:
    return -(-size // _LINE) * _LINE
