"""Visibility tables: the nodes that each node sees; computed, stored in files, and dropped when outdated."""

import os
from collections.abc import Iterable
from contextlib import nullcontext
from hashlib import sha256
from pathlib import Path
from struct import pack
from typing import Any, Literal, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int, as_path, as_range, as_target
from gamms.errors import BadFile, BadValue, Outdated, UnknownName
from gamms.folders import cache_folder, write_whole
from gamms.graph import map_file, records
from gamms.graph.obstacles import Obstacles
from gamms.graph.routes import CachedRoutes
from gamms.graph.storage import MapStorage
from gamms.graph.store import GraphStore
from gamms.graph.tables import RowIndex
from gamms.graph.visibility_workers import RowArray, VisibilityRows, VisibilityTask, compute_visibility
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.progress import show_progress as shown
from gamms.readonly import Shareable
from gamms.typing import IContext
from gamms.typing.graph_values import NodeIds
from gamms.typing.obstacles import IVisibility

_SUFFIX = ".sight"
_MAGIC = b"GAMMSEYE"  # first bytes of a file; see docs/save-format.md
_VERSION = 3  # versions 1 and 2 were used by development versions; they are not supported

TablePath = str | os.PathLike[str] | Literal[False] | None


class MapFingerprint:
    """The nodes and faces of a visibility table, to check whether they are unchanged.

    Other changes of the graph, for example closed roads, do not matter.

    Attributes:
        store: the graph.
    """

    def __init__(self, store: GraphStore, obstacles: Obstacles) -> None:
        self.store = store
        self._obstacles = obstacles
        self._revisions = self._get_revisions()
        self._is_current = True
        self.node_ids, self.xy, *ground = _list_nodes(store)
        self.ground = ground[0] if ground else np.zeros((len(self.xy), 2))  # (nodes, 2) height, tunnel
        self.corners: FloatArray = obstacles.columns().corners  # (faces, 4, 3)
        self._nodes = _digest(self.node_ids, self.xy, *ground)
        self._faces = _digest(self.corners)

    @property
    def is_current(self) -> bool:
        """Whether the nodes and faces are unchanged."""
        now = self._get_revisions()
        if now != self._revisions:
            is_same = _digest(*_list_nodes(self.store)) == self._nodes
            if is_same and now[1] != self._revisions[1]:
                is_same = _digest(self._obstacles.columns().corners) == self._faces
            self._revisions = now
            self._is_current = is_same
        return self._is_current

    def compute_key(self, radius: float, observer_height: float) -> bytes:
        """Return 32 bytes that depend on the map, the radius and the height."""
        parts = b"gamms sight 2", self._nodes, self._faces, pack("<dd", radius, observer_height)
        return sha256(b"".join(parts)).digest()

    def _get_revisions(self) -> tuple[int, int]:
        return self.store.revision, self._obstacles.revision


def _list_nodes(store: GraphStore) -> "tuple[np.ndarray[tuple[int, ...], np.dtype[Any]], ...]":
    """Return ids (nodes,) and coordinates (nodes, 2), in insertion order, and the ground unless it is flat."""
    rows = store.nodes.list_living()
    ground = store.get_ground()
    nodes = store.nodes.get_array("ids")[rows], store.nodes.get_array("xy")[rows]
    return nodes if ground is None else (*nodes, ground[rows])


def _digest(*arrays: "np.ndarray[tuple[int, ...], np.dtype[np.generic]]") -> bytes:
    digest = sha256()
    for array in arrays:
        digest.update(pack("<Q", len(array)))
        digest.update(array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes())
    return digest.digest()


class Visibility(Shareable, IVisibility):
    """Compressed rows: for each node, in insertion order, the nodes that it sees.

    Args:
        fingerprint: identifies the map of the table.
        routes: routes of the graph.
        radius: see `IVisibility`.
        observer_height: see `IVisibility`.
        seen: the rows of the nodes that each node sees.
    """

    def __init__(
        self,
        fingerprint: MapFingerprint,
        routes: CachedRoutes,
        radius: float,
        observer_height: float,
        seen: VisibilityRows,
    ) -> None:
        self._fingerprint = fingerprint
        self._routes = routes
        self._radius = radius
        self._observer_height = observer_height
        self._ids = fingerprint.node_ids
        self._index = RowIndex()
        self._index.extend(self._ids, 0, "a node")
        self.seen = seen
        self._offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(seen.counts, dtype=np.int64)))
        self._rows = seen.rows
        self._by_target: tuple[IntArray, RowArray] | None = None

    @property
    def radius(self) -> float:
        """The radius within which sight lines were computed, map units."""
        return self._radius

    @property
    def observer_height(self) -> float:
        """The height of both ends of every sight line above the ground at their nodes, map units."""
        return self._observer_height

    @property
    def is_current(self) -> bool:
        """Whether the nodes and obstacles are unchanged since the table was computed."""
        return self._fingerprint.is_current

    def __len__(self) -> int:
        return len(self._ids)

    def sees(self, observer: int, target: int) -> bool:
        """Return whether a node within the radius of another is visible from there."""
        seen = self._find_visible(self._find_row(observer))
        row = self._find_row(target)
        place = int(seen.searchsorted(row))
        return place < len(seen) and int(seen[place]) == row

    def mask(self, observer_id: int, ids: Iterable[int]) -> BoolArray:
        """Return whether each of some nodes (nodes,) is within the radius of a node and visible from it."""
        is_seen = np.zeros(len(self._ids), np.bool_)
        is_seen[self._find_visible(self._find_row(observer_id))] = True
        asked = ids if isinstance(ids, np.ndarray) else list(ids)
        return is_seen[self._index.find_rows(records.check_ids(asked, "ids", self._fingerprint.store), "node")]

    def from_node(self, node_id: int) -> IntArray:
        """Return the ids of the nodes that are visible from a node, itself included."""
        return self._ids[self._find_visible(self._find_row(node_id))]

    def watchers(self, node_id: int) -> IntArray:
        """Return the ids of the nodes from which a node is visible, itself included."""
        row = self._find_row(node_id)
        if self._by_target is None:
            offsets, order = kernels.group_rows(self._rows.astype(np.int64), len(self))
            observers: RowArray = np.repeat(np.arange(len(self), dtype=np.int32), self.seen.counts)
            self._by_target = offsets, observers[order]
        offsets, observers = self._by_target
        return self._ids[observers[offsets[row] : offsets[row + 1]]]

    def coverage(self, node_ids: NodeIds) -> IntArray:
        """Return the ids of the nodes that are visible from at least one of some nodes."""
        return self._ids[self._is_covered(node_ids)]

    def hidden(self, watchers: NodeIds) -> IntArray:
        """Return the ids of the nodes that are visible from none of some nodes."""
        return self._ids[~self._is_covered(watchers)]

    def nearest_hidden(self, node_id: int, watchers: NodeIds, weight: str | None = "length") -> int | None:
        """Return the id of the nearest node, by path, that is hidden from all watchers."""
        row = self._find_row(node_id)
        is_covered = self._is_covered(watchers)
        if not is_covered[row]:
            return int(self._ids[row])
        distances = self._routes.distances(node_id, None, weight, None)
        ids = np.fromiter(distances, np.int64, len(distances))
        far = np.fromiter(distances.values(), np.float64, len(distances))
        is_hidden = ~is_covered[self._index.find_rows(ids, "node")]
        return int(ids[is_hidden][far[is_hidden].argmin()]) if is_hidden.any() else None

    # -- rows ---------------------------------------------------------------------------------------------------

    def _find_row(self, node_id: int) -> int:
        self._refuse_outdated()
        row = self._index.find_row(records.as_id(node_id, "a node", self._fingerprint.store))
        if row < 0:
            raise UnknownName("node", node_id)
        return row

    def _find_visible(self, row: int) -> RowArray:
        return self._rows[self._offsets[row] : self._offsets[row + 1]]

    def _is_covered(self, node_ids: NodeIds) -> BoolArray:
        self._refuse_outdated()
        asked = list(node_ids) if isinstance(node_ids, Iterable) else [node_ids]
        ids = np.array([records.as_id(id, "a node", self._fingerprint.store) for id in asked], np.int64)
        is_covered = np.zeros(len(self), np.bool_)
        for row in self._index.find_rows(ids, "node").tolist():
            is_covered[self._find_visible(row)] = True
        return is_covered

    def _refuse_outdated(self) -> None:
        if not self._fingerprint.is_current:
            raise Outdated("nodes or obstacles have changed since this table was made", "ctx.graph.visibility(…)")


class VisibilityTables:
    """The visibility tables of a graph and its obstacles, by radius and height.

    Args:
        store: the graph.
        routes: routes of the graph.
        obstacles: the faces that block sight.
        ctx: its logger gets warnings about files that cannot be used.
        storage: stores the rows of tables; shared with other contexts.
    """

    def __init__(
        self, store: GraphStore, routes: CachedRoutes, obstacles: Obstacles, ctx: IContext, storage: MapStorage
    ) -> None:
        self._store = store
        self._routes = routes
        self._obstacles = obstacles
        self._ctx = ctx
        self._storage = storage
        self._tables: dict[tuple[float, float], Visibility] = {}

    def find(self, radius: float, observer_height: float) -> Visibility | None:
        """Return the smallest current table of this height with at least this radius, or None."""
        fitting = [table for (_, height), table in self._tables.items() if height == observer_height]
        fitting = [table for table in fitting if table.radius >= radius and table.is_current]
        return min(fitting, key=lambda table: table.radius, default=None)

    def get(
        self, radius: float, observer_height: float, path: TablePath, *, progress: bool, workers: int | None
    ) -> Visibility:
        """Return a table from memory, else from its file, else computed; see `IGraphEngine.visibility`."""
        reach = as_range(radius, "radius")
        height = as_float(observer_height, "observer_height")
        if workers is not None and as_int(workers, "workers") < 1:
            raise BadValue(f"workers must be at least 1, not {workers}; None uses one for each processor.")
        self._tables = {key: table for key, table in self._tables.items() if table.is_current}
        table = self._tables.get((reach, height))
        if table is not None and not path:
            return table
        fingerprint = MapFingerprint(self._store, self._obstacles)
        key = fingerprint.compute_key(reach, height)
        place = self._open_place(path, key)
        kept = self._read(place, key, len(fingerprint.node_ids))
        if table is None:
            task = VisibilityTask(fingerprint.xy, fingerprint.corners, reach, height, fingerprint.ground)
            seen = self._storage.visibility_rows.get(
                0, key, lambda: kept or _make_rows(task, workers, is_shown=progress)
            )
            table = Visibility(fingerprint, self._routes, reach, height, seen)
            self._tables[reach, height] = table
        if place is not None and kept is None:
            self._write(place, encode(table.seen, key, reach, height))
        return table

    def _open_place(self, path: TablePath, key: bytes) -> "_TableFile | None":
        name = key.hex()[:32] + _SUFFIX
        if path is False:
            return None
        if path is not None:
            asked = as_path(path, "path")
            if asked.is_dir():
                return _TableFile(asked / name, is_asked=True)
            return _TableFile(as_target(asked), is_asked=True, is_ours=not _is_foreign(asked))
        folder = cache_folder("visibility")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self._ctx.logger.warning(f"The visibility table cannot be stored: {error}. {_ANOTHER_PATH}")
            return None
        return _TableFile(folder / name)

    def _read(self, place: "_TableFile | None", key: bytes, nodes: int) -> VisibilityRows | None:
        try:
            return None if place is None else decode(place.path.read_bytes(), key, nodes)
        except FileNotFoundError:
            return None
        except (BadFile, OSError) as error:
            self._ctx.logger.warning(f"{place.path} is not a visibility table: {error}. The table is computed again.")  # type: ignore[union-attr] # there is a place
            return None

    def _write(self, place: "_TableFile", data: bytes) -> None:
        if not place.is_ours:
            self._ctx.logger.warning(f"{place.path} is another file, and is not overwritten. {_ANOTHER_PATH}")
            return
        try:
            write_whole(place.path, data)
        except OSError as error:
            if place.is_asked:
                error.add_note(f"The visibility table was computed, but could not be stored. {_ANOTHER_PATH}")
                raise
            self._ctx.logger.warning(f"The visibility table cannot be stored: {error}. {_ANOTHER_PATH}")


_ANOTHER_PATH = "Give a path= that can be written to, or path=False to keep the table in memory only."


class _TableFile(NamedTuple):
    """The file of a visibility table."""

    path: Path
    is_asked: bool = False  # whether the caller gave the path and must see errors
    is_ours: bool = True  # False: the file is of another kind and must not be overwritten


def _make_rows(task: VisibilityTask, workers: int | None, *, is_shown: bool) -> VisibilityRows:
    with shown(0.0) if is_shown else nullcontext(lambda _: None) as show:
        seen = compute_visibility(task, workers, show)
    for array in seen:
        array.flags.writeable = False  # other engines may share it
    return seen


# -- files ------------------------------------------------------------------------------------------------------------


def encode(seen: VisibilityRows, key: bytes, radius: float, observer_height: float) -> bytes:
    """Return a table as the bytes of a file."""
    state = {"key": key, "radius": radius, "observer_height": observer_height, **seen._asdict()}
    return map_file.frame_file(state, _MAGIC, _VERSION)


def decode(data: bytes, key: bytes, nodes: int) -> VisibilityRows | None:
    """Decode a table; return None if it belongs to another map, radius or height.

    Raises:
        BadFile (ValueError): the file is damaged, foreign or too new.
    """
    with map_file.report_damage():
        state = map_file.unframe_file(data, _MAGIC, _VERSION)
        if type(state["key"]) is not bytes:
            raise BadFile("its key is damaged")
        if state["key"] != key:
            return None
        counts, rows = seen = VisibilityRows(state["counts"], state["rows"])
        is_sound = counts.dtype == rows.dtype == np.int32 and counts.shape == (nodes,) and rows.ndim == 1
        if not is_sound or (counts < 1).any() or int(counts.sum(dtype=np.int64)) != len(rows):
            raise BadFile("its counts are damaged")
        is_ascending = np.concatenate(([True], rows[1:] > rows[:-1]))[: len(rows)]
        is_ascending[np.cumsum(counts, dtype=np.int64) - counts] = True
        if not is_ascending.all() or (rows < 0).any() or (rows >= nodes).any():
            raise BadFile("its rows are damaged")
        return seen


def _is_foreign(path: Path) -> bool:
    """Return whether a file of another kind exists at the path."""
    try:
        with path.open("rb") as file:
            begin = file.read(len(_MAGIC))
    except FileNotFoundError:
        return False
    return begin != _MAGIC[: len(begin)]
