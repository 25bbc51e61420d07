"""What both readers answer to the bytes of a file, as JSON: its contents, or the limit that it breaks and the byte."""

import io
import json
import re
from math import isfinite

import numpy as np
import second_reader

import gamms
from gamms.errors import BadFile
from gamms.graph import map_file, visibility
from gamms.ir.scenery import Scenery
from gamms.knowledge.fields import FieldTable
from gamms.knowledge.looks import decode_looks, refuse_many
from gamms.recorder import Reader, RecordingError
from gamms.recorder.errors import report_damage

# What GAMMS says of a file that breaks a limit.
MESSAGES = {
    "magic": "not a recording|right bytes",
    "version": "has format version",
    "header": "no header here|no block here|head of this block|bytes are stated|too many$",
    "crc": "is damaged$|damaged or cut off",
    "missing bytes": "only [0-9]+ exist|cut off|out of range",
    "superfluous bytes": "left over|extra bytes",
    "size": "decompress|number is too long",
    "memory": "unpacks to more|too many for the size",
    "hashes": "made to have one hash",
    "value": "a value is damaged|invalid beginning",
    "depth": "more than 32 levels",
    "key": "same key twice|unhashable",
    "array": "an array has|a value is damaged|array of the right type|a column is cut off|damaged$|has shape"
    "|scenery is damaged|columns of a scenery|has no attribute|contents are damaged",
    "dict": "its key is damaged|not a keyframe|no header|contents are damaged|'world'|graph is bytes",
    "column": "cannot have|does not fit its table",
    "counts": "damaged|add up to",
    "events": "out of place|not numbers",
    "ids": "twice",
    "rows": "row that does not exist|damaged$",
    "finite": "finite",
    "lengths": "negative|finite",
    "sizes": "looks are damaged|are damaged|three points or more|scenery is damaged",
    "points": "at most",
    "text": "string or None|contents are damaged",
    "attribute": "attribute .* is damaged|does not exist|contents are damaged",
    "closed": "contents are damaged|closed edge",
    "scenery": "both a scenery by name and a base map",
    "looks": "looks are damaged",
    "fields": "looks are damaged",
}


def as_json(value):
    """Return a value as JSON: whatever JSON lacks is an object with one key that says what it is."""
    kind = type(value)
    if kind is str and len(value) > 1000 and set(value) == {value[0]}:
        return {"text": value[0], "times": len(value)}
    if value is None or kind in (bool, int, str):
        return value
    if kind is float:
        return value if isfinite(value) else {"float": str(value)}
    if kind is bytes:
        return {"bytes": value.hex()}
    if kind is list:
        return [as_json(item) for item in value]
    if kind is dict:
        return {"dict": [[as_json(key), as_json(item)] for key, item in value.items()]}
    if isinstance(value, np.ndarray):
        value = second_reader.Array(str(value.dtype), list(value.shape), value.reshape(-1).tolist())
    if isinstance(value, second_reader.Array):
        return {"array": value.dtype, "shape": value.shape, "items": [as_json(item) for item in value.items]}
    items = [as_json(item) for item in value]
    if kind in (set, frozenset):
        items.sort(key=json.dumps)
    return {kind.__name__: items}


def as_text(answer):
    """Return an answer as the text of a JSON file, with a line for each of its parts."""
    parts = (f"{json.dumps(key)}: {json.dumps(part)}" for key, part in answer.items())
    return "{\n" + ",\n".join(parts) + "\n}\n"


# -- GAMMS ------------------------------------------------------------------------------------------------------


def read_recording(data):
    """Return the contents of a .ggr file, as `second_reader.read_recording` does."""
    with Reader(io.BytesIO(data)) as reader:
        reader.verify()
        answer = {"header": reader.header, "turns": [_pair_moves(reader.log(turn)) for turn in range(reader.turns)]}
        states = filter(None, map(reader.keyframe, range(reader.turns + 1)))
        answer |= {"is_complete": reader.is_complete, "keyframes": dict(states)}
        return answer | ({"looks": read_looks(reader)} if has_looks(answer) else {})


def has_looks(recording):
    """Return whether a turn has sensed data."""
    return any(kind == second_reader.SENSED for turn in recording["turns"] for kind, _ in turn)


def read_looks(reader):
    """Return the looks of each turn, as `second_reader.read_looks` does."""
    fields = FieldTable()
    turns = []
    with report_damage("Its looks are damaged"), gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        has_map = "world" in reader.header
        if has_map:
            ctx.graph.storage.unpack(reader.header["world"])
        first_map = ctx.graph.columns()
        get_map = (lambda: first_map) if has_map else None
        for turn in range(reader.turns):
            turns.append([])
            events = [entry for entry in reader.log(turn) if type(entry) is tuple]
            refuse_many([data for kind, data in events if kind == second_reader.SENSED])
            for kind, data in events:
                if kind == second_reader.NEW_MAP:
                    ctx.graph.storage.unpack(data["world"])
                    has_map = True
                if kind == second_reader.SENSED:
                    looks = decode_looks(data, None, fields, get_map)
                    graph = ctx.graph.graph if has_map else None
                    turns[-1] += [(agent, *look[:-1], find_covered(look.field, graph)) for agent, look in looks]
    return turns


def find_covered(field, graph):
    """Return the ids of the nodes that a field covers; None without a field or a map."""
    return None if field is None or graph is None else field.list_nodes(graph).tolist()


def _pair_moves(log):
    pairs = []
    at = 0
    while at < len(log):
        is_event = type(log[at]) is tuple
        pairs.append(log[at] if is_event else (log[at], log[at + 1]))
        at += 1 if is_event else 2
    return pairs


def read_map(data):
    """Return the columns of a .gamms file, as `second_reader.read_map` does."""
    saved = map_file.decode(data)
    graph = saved.columns
    is_named = not isinstance(saved.scenery, Scenery)
    columns = {name: getattr(graph, name).tolist() for name in ("node_ids", "xy", "edge_ids", "sources", "targets")}
    return columns | {
        "texts": [graph.crs, saved.attribution, saved.scenery if is_named else None],
        "lengths": graph.lengths.tolist(),
        "bends": {row: points.tolist() for row, points in graph.polylines.items()},
        "face_ids": [face.id for face in saved.faces],
        "face_types": [face.type for face in saved.faces],
        "face_corners": [[part for corner in face[1:5] for part in corner] for face in saved.faces],
        "node_attributes": graph.node_attributes,
        "edge_attributes": graph.edge_attributes,
        "closed": [edge | _list_points(edge) for edge in saved.closed.values()],
        "base_map": None if is_named else _list_shapes(saved.scenery),
    }


def _list_points(edge):
    line = edge.get("linestring")
    return {} if line is None else {"linestring": line.tolist()}


def _list_shapes(scenery):
    return {
        "kinds": scenery.kinds.tolist(),
        "shapes": [part.tolist() for part in np.split(scenery.points, scenery.offsets[1:-1])],
        "face_types": scenery.buildings.types.tolist(),
        "face_corners": scenery.buildings.corners.reshape(-1, 12).tolist(),
    }


def read_sight(data):
    """Return the contents of a .sight file, as `second_reader.read_sight` does."""
    with map_file.report_damage():
        state = map_file.unframe_file(data, b"GAMMSEYE", visibility._VERSION)
        answer = {name: state[name] for name in ("key", "radius", "observer_height")}
        seen = visibility.decode(data, state["key"], len(state["counts"]))
    ends = np.cumsum(seen.counts)
    parts = zip((ends - seen.counts).tolist(), ends.tolist(), strict=True)
    return answer | {"seen": [seen.rows[start:end].tolist() for start, end in parts]}


def name_rows(columns):
    """Return the answer to a .gamms file: the columns of either reader, by ids."""
    nodes, edges = columns["node_ids"], columns["edge_ids"]
    ends = zip(edges, columns["sources"], columns["targets"], columns["lengths"], strict=True)
    bends = columns["bends"]
    base_map = columns["base_map"]
    return dict(zip(("crs", "attribution", "scenery"), columns["texts"], strict=True)) | {
        "nodes": [[id, *xy] for id, xy in zip(nodes, columns["xy"], strict=True)],
        "edges": [[id, nodes[a], nodes[b], length, bends.get(row)] for row, (id, a, b, length) in enumerate(ends)],
        "faces": _join(columns["face_ids"], columns["face_types"], columns["face_corners"]),
        "node_attributes": _name_rows(columns["node_attributes"], nodes),
        "edge_attributes": _name_rows(columns["edge_attributes"], edges),
        "closed": [edge | _convert_line(edge.get("linestring")) for edge in columns["closed"]],
        "base_map": base_map
        and {
            "shapes": [list(shape) for shape in zip(base_map["kinds"], base_map["shapes"], strict=False)],
            "walls": _join(base_map["face_types"], base_map["face_corners"]),
        },
    }


def _convert_line(points):
    return {} if points is None else {"linestring": [[float(x), float(y)] for x, y in points]}


def _join(*columns):
    return [[*values, *corners] for *values, corners in zip(*columns, strict=True)]


def _name_rows(attributes, ids):
    return {name: [[ids[row], value] for row, value in by_row.items()] for name, by_row in attributes.items()}


GAMMS = {".ggr": read_recording, ".gamms": lambda data: name_rows(read_map(data)), ".sight": read_sight}
SECOND = {
    ".ggr": lambda data: add_looks(second_reader.read_recording(data)),
    ".gamms": lambda data: name_rows(second_reader.read_map(data)),
    ".sight": second_reader.read_sight,
}


def add_looks(recording):
    """Add the looks of sensors to the second reader's answer, if there are any."""
    return recording | ({"looks": second_reader.read_looks(recording)} if has_looks(recording) else {})


def ask_gamms(suffix, data):
    """Return what GAMMS answers, and its message if it refuses."""
    try:
        contents = GAMMS[suffix](data)
    except (RecordingError, BadFile) as error:
        message = str(error).rstrip(".")
        byte = re.search("at byte ([0-9]+)", message)
        return {"refused": None, "byte": int(byte[1]) if byte else None}, message
    return _with_json(contents), ""


def ask_second(suffix, data):
    """Return what the second reader answers."""
    try:
        contents = SECOND[suffix](data)
    except second_reader.Refused as error:
        limit, byte = error.args
        return {"refused": limit, "byte": byte}
    return _with_json(contents)


def _with_json(contents):
    return {key: as_json(contents[key]) for key in sorted(contents)}
