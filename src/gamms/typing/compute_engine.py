"""Contract of background work; no engine implements it yet, `ctx.ictx.compute` is None."""

from abc import ABC, abstractmethod
from enum import Enum


class TaskStatus(Enum):
    """Where a task is in its life."""

    PENDING = 0
    RUNNING = 1
    COMPLETED = 2
    FAILED = 3


class ITask(ABC):
    """A unit of work."""

    @property
    @abstractmethod
    def id(self) -> str:
        """A name that no other task has."""

    @property
    @abstractmethod
    def status(self) -> TaskStatus:
        """Where the task is in its life."""

    @abstractmethod
    def run(self) -> None:
        """Do the work, once."""


class IComputeEngine(ABC):
    """Runs tasks."""

    @abstractmethod
    def submit(self, task: ITask) -> None:
        """Queue `task`."""

    @abstractmethod
    def wait(self, task: ITask) -> None:
        """Block until `task` has ended; raise what it raised."""

    @abstractmethod
    def terminate(self) -> None:
        """End the engine."""
