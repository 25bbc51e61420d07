"""A graph in a database file, through the stores behind `ctx.ictx.memory`; see `typing/memory_engine.py`."""

from typing import Any

import numpy as np

from gamms.errors import BadFile, BadValue, GammsError, TooLarge, WriteConflict
from gamms.graph import plain
from gamms.graph.contents import Contents, checked_columns
from gamms.graph.obstacles import checked_face
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.text import shown
from gamms.typing.memory_engine import IPathLike

STORE = ".graph"  # the dot: no store of the program's, and not listed among those

_CORNERS = [f"{corner}{axis}" for corner in ("tr", "tl", "br", "bl") for axis in "xyz"]
_SCHEMAS: dict[str, dict[str, type]] = {
    "nodes": {"id": int, "x": float, "y": float, "attributes": str},
    "edges": {
        "id": int,
        "source": int,
        "target": int,
        "length": float,
        "linestring": bytes,
        "attributes": str,
    },
    "obstacle_face": {"id": int, **dict.fromkeys(_CORNERS, float), "type": int},
    "about": {"key": str, "value": str},
}


class NoFile(IPathLike):
    """The path of a database in memory."""

    def as_str(self) -> str:
        """What SQLite calls it."""
        return ":memory:"

    def exists(self) -> bool:
        """There is no file."""
        return False


class GraphDatabase:
    """Writes a graph into a store and reads it again; `store` is a DATABASE store of `ctx.ictx.memory`.

    The table `about` counts the saves, so that no program writes over what it has not read.
    """

    def __init__(self, store: Any) -> None:  # Any: the bulk methods are the store's own, beyond IStore
        self._store = store
        self._saves = 0  # that had been made when the graph was read
        if store.is_foreign:
            raise BadFile(f"{store.path().as_str()} is a database of something else, not of a graph.")
        for name, schema in _SCHEMAS.items():
            try:
                store.create_map(name, schema, next(iter(schema)))
            except GammsError as error:
                raise BadFile(
                    f"{store.path().as_str()} cannot be opened as the database of a graph: {error}"
                ) from error
        store.flush()

    @property
    def path(self) -> str:
        """The path of the file."""
        path: str = self._store.path().as_str()
        return path

    def read(self) -> Contents:
        """The graph that was written last.

        Raises:
            BadFile: the tables do not make a graph.
        """
        try:
            with self._store.transaction(is_writing=False):
                tables = {name: self._store.read_columns(name) for name in _SCHEMAS}
            contents = _contents_of(tables, plain.Texts(self._store.allowance()))
            self._saves = _saves_of(tables["about"])
        except (GammsError, KeyError, ValueError, TypeError) as error:
            kind = TooLarge if isinstance(error, TooLarge) else BadFile
            raise kind(f"{self.path} does not hold a graph that GAMMS can load: {error}") from error
        return contents

    def write(self, contents: Contents) -> None:
        """Replace what the database holds.

        Raises:
            BadValue: an attribute is no plain data; the database keeps the graph it had.
            WriteConflict: another program has saved since the graph was read; the database keeps what that saved.
            BadFile: the file cannot be written; it keeps the graph it had.
        """
        tables = _tables_of(contents, self._saves + 1)
        with self._store.transaction():
            if _saves_of(self._store.read_columns("about")) != self._saves:
                raise WriteConflict(
                    f"Another program has saved to {self.path} since this context read it, and saving now would undo "
                    "that. Keep this graph in another file with ctx.graph.save('mine.gamms'), or drop it and read "
                    "what is in the database with ctx.graph.load()."
                )
            for name, columns in tables.items():
                self._store.clear_map(name)
                self._store.insert_many(name, columns)
        self._saves += 1


def _saves_of(about: dict[str, list[Any]]) -> int:
    """How often the graph was saved; older files do not say."""
    return int(dict(zip(about["key"], about["value"], strict=True)).get("saves", 0))


def _tables_of(contents: Contents, saves: int) -> dict[str, dict[str, list[Any]]]:
    graph, faces = contents.columns, contents.faces
    texts = (("crs", graph.crs), ("attribution", contents.attribution), ("saves", str(saves)))
    about = {key: text for key, text in texts if text is not None}
    ids = graph.node_ids
    edges = range(len(graph.edge_ids))
    return {
        "nodes": {
            "id": ids.tolist(),
            "x": graph.xy[:, 0].tolist(),
            "y": graph.xy[:, 1].tolist(),
            "attributes": _attribute_texts(graph.node_attributes, len(ids), "node"),
        },
        "edges": {
            "id": graph.edge_ids.tolist(),
            "source": ids[graph.sources].tolist(),
            "target": ids[graph.targets].tolist(),
            "length": graph.lengths.tolist(),
            "linestring": [_bytes(graph.bends.get(row)) for row in edges],
            "attributes": _attribute_texts(graph.edge_attributes, len(edges), "edge"),
        },
        "obstacle_face": {
            "id": [face.id for face in faces],
            **{
                name: [face[1 + i // 3][i % 3] for face in faces]  # type: ignore[index] # fields 1-4 are corners
                for i, name in enumerate(_CORNERS)
            },
            "type": [face.type for face in faces],
        },
        "about": {"key": list(about), "value": list(about.values())},
    }


def _contents_of(tables: dict[str, dict[str, list[Any]]], texts: plain.Texts) -> Contents:
    nodes, edges, faces = tables["nodes"], tables["edges"], tables["obstacle_face"]
    about = dict(zip(tables["about"]["key"], tables["about"]["value"], strict=True))
    row_of = {id: row for row, id in enumerate(nodes["id"])}
    arrays = {
        "node_ids": np.array(nodes["id"], np.int64),
        "xy": np.column_stack([np.array(nodes[axis], np.float64) for axis in "xy"]),
        "edge_ids": np.array(edges["id"], np.int64),
        "sources": np.array([row_of[id] for id in edges["source"]], np.int64),
        "targets": np.array([row_of[id] for id in edges["target"]], np.int64),
        "lengths": np.array(edges["length"], np.float64),
    }
    bends = {row: _points(data) for row, data in enumerate(edges["linestring"]) if data is not None}
    attributes = (_attributes(nodes["attributes"], texts), _attributes(edges["attributes"], texts))
    graph: GraphColumns = checked_columns(arrays, bends, attributes, about.get("crs"))
    corners = zip(*(faces[name] for name in _CORNERS), strict=True)
    checked = [
        checked_face(id, c[0:3], c[3:6], c[6:9], c[9:12], type)
        for id, c, type in zip(faces["id"], corners, faces["type"], strict=True)
    ]
    return Contents(graph, checked, about.get("attribution"))


def _attribute_texts(attributes: Any, rows: int, kind: str) -> list[str | None]:
    texts: list[str | None] = [None] * rows
    for row in sorted({row for values in attributes.values() for row in values}):
        given = {name: values[row] for name, values in attributes.items() if row in values}
        try:
            texts[row] = plain.to_text(given, "A dict of attributes")
        except BadValue:
            for name, value in given.items():
                plain.to_text(value, f"{kind.capitalize()} attribute {name!r}")  # raises for the one that is to blame
            raise
    return texts


def _attributes(column: list[str | None], texts: plain.Texts) -> dict[str, dict[int, Any]]:
    attributes: dict[str, dict[int, Any]] = {}
    for row, text in enumerate(column):
        if text is not None:
            given = texts.read(text)
            if not isinstance(given, dict) or not all(isinstance(name, str) for name in given):
                raise BadValue(f"attributes must be a dict by name, not {shown(given)}")
            for name, value in given.items():
                attributes.setdefault(name, {})[row] = value
    return attributes


def _bytes(bend: FloatArray | None) -> bytes | None:
    return None if bend is None else bend.astype("<f8").tobytes()


def _points(data: bytes) -> FloatArray:
    points = np.frombuffer(data, "<f8").astype(np.float64).reshape(-1, 2)
    if len(points) < 2:
        raise BadValue("a polyline has fewer than two points")
    points.setflags(write=False)
    return points
