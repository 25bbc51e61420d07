"""The visibility tables of one engine: made, kept in files and found again; those that no longer hold are dropped."""

import os
from contextlib import nullcontext
from pathlib import Path
from typing import Literal, NamedTuple

from gamms.arguments import as_float, as_int, as_path, as_range
from gamms.errors import BadFile, BadValue, MissingFolder
from gamms.folders import cache_folder, write_whole
from gamms.graph import sight_file
from gamms.graph.cache import Cache
from gamms.graph.graph import Graph
from gamms.graph.obstacles import Obstacles
from gamms.graph.sights import Scene, Seen, all_seen
from gamms.graph.visibility import Visibility
from gamms.graph.worlds import World
from gamms.progress import progress as shown
from gamms.typing import IContext

_SUFFIX = ".sight"

TablePath = str | os.PathLike[str] | Literal[False] | None


class VisibilityTables:
    """The tables of a graph and its obstacles, by radius and height.

    Args:
        graph: whose nodes see each other.
        obstacles: what they cannot see through.
        ctx: whose logger is told of files that cannot be used.
        sights: the rows of tables, of other engines too, by the key of their world.
    """

    def __init__(self, graph: Graph, obstacles: Obstacles, ctx: IContext, sights: Cache) -> None:
        self._graph, self._obstacles, self._ctx, self._sights = graph, obstacles, ctx, sights
        self._tables: dict[tuple[float, float], Visibility] = {}

    def find(self, observer_height: float, radius: float) -> Visibility | None:
        """The table of that height that holds and reaches so far; the smallest of several."""
        fitting = [table for (_, height), table in self._tables.items() if height == observer_height]
        fitting = [table for table in fitting if table.radius >= radius and table.is_current]
        return min(fitting, key=lambda table: table.radius, default=None)

    def get(
        self, radius: float, observer_height: float, path: TablePath, *, progress: bool, workers: int | None
    ) -> Visibility:
        """The table as it is known, else from its file, else made; see `IGraphEngine.visibility`."""
        reach, height = as_range(radius, "radius"), as_float(observer_height, "observer_height")
        if workers is not None and as_int(workers, "workers") < 1:
            raise BadValue(f"workers must be at least 1, not {workers}; None takes one for each processor.")
        self._tables = {key: table for key, table in self._tables.items() if table.is_current}
        table = self._tables.get((reach, height))
        if table is not None and not path:
            return table
        world = World(self._graph, self._obstacles)
        key = world.key(reach, height)
        place = self._place(path, key)
        kept = self._read(place, key, len(world.node_ids))
        if table is None:
            scene = Scene(world.xy, world.corners, reach, height)
            seen = self._sights.get(0, key, lambda: kept or _made(scene, workers, is_shown=progress))
            table = self._tables[reach, height] = Visibility(world, reach, height, seen)
        if place is not None and kept is None:
            self._write(place, sight_file.encode(table.seen, key, reach, height))
        return table

    def _place(self, path: TablePath, key: bytes) -> "_Place | None":
        name = key.hex()[:32] + _SUFFIX
        if path is False:
            return None
        if path is not None:
            asked = as_path(path, "path")
            if asked.is_dir():
                return _Place(asked / name, is_asked=True)
            if not asked.parent.is_dir():
                raise MissingFolder(asked.name, asked.parent)
            return _Place(asked, is_asked=True, is_ours=not sight_file.is_foreign(asked))
        folder = cache_folder("visibility")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self._ctx.logger.warning(f"The visibility table cannot be kept for later: {error}. {_ANOTHER_PATH}")
            return None
        return _Place(folder / name)

    def _read(self, place: "_Place | None", key: bytes, nodes: int) -> Seen | None:
        try:
            return None if place is None else sight_file.read(place.path, key, nodes)
        except (BadFile, OSError) as error:
            self._ctx.logger.warning(f"{place.path} is no visibility table: {error}. It is worked out anew.")  # type: ignore[union-attr] # there is a place
            return None

    def _write(self, place: "_Place", data: bytes) -> None:
        if not place.is_ours:
            self._ctx.logger.warning(f"{place.path} is something else, and is left as it is. {_ANOTHER_PATH}")
            return
        try:
            write_whole(place.path, data)
        except OSError as error:
            if place.is_asked:
                error.add_note(f"The visibility table is made, but could not be kept. {_ANOTHER_PATH}")
                raise
            self._ctx.logger.warning(f"The visibility table cannot be kept for later: {error}. {_ANOTHER_PATH}")


_ANOTHER_PATH = "Give a path= that can be written to, or path=False to keep the table in memory only."


class _Place(NamedTuple):
    """Where a table is kept."""

    path: Path
    is_asked: bool = False  # by the caller, who wants to know if it does not work
    is_ours: bool = True  # else there is somebody's file, which is not to be overwritten


def _made(scene: Scene, workers: int | None, *, is_shown: bool) -> Seen:
    with shown(0.0) if is_shown else nullcontext(_say_nothing) as show:
        seen = all_seen(scene, workers, show)
    for array in seen:
        array.flags.writeable = False  # other engines may share it
    return seen


def _say_nothing(_: str) -> None:
    pass
