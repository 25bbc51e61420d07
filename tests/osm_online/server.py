"""A map server on this computer: it answers like Nominatim and Overpass, from a real extract, or misbehaves on request.

It understands questions such as `(way["highway"]["area"!~"^(yes)$"](poly:'60.1 24.9 ...'););(._;>;);out;`.
Areas are taken by their exact outline.
"""

import gzip
import json
import re
import threading
from collections.abc import Callable
from contextlib import contextmanager, suppress
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree as ET

import shapely

EXTRACT = Path(__file__).parent / "data" / "kluuvi.osm.gz"
WEST, SOUTH, EAST, NORTH = 24.9410, 60.1672, 24.9510, 60.1708  # inside the extract, as its streets reach farther

_PART = re.compile(r"(node|way|relation)((?:\[[^\]]*\])+)\(poly:'([^']*)'\)")
_FILTER = re.compile(r"""\[["']?([^"'=!~\]]+)["']?(?:(!~|!=|~|=)["']?([^"'\]]*)["']?)?\]""")


def box(west, south, east, north):
    return {
        "type": "Polygon",
        "coordinates": [[[west, south], [east, south], [east, north], [west, north], [west, south]]],
    }


def place(geojson, importance=0.5):
    shape = shapely.from_geojson(json.dumps(geojson))
    west, south, east, north = shape.bounds
    return {
        "place_id": 1,
        "osm_type": "relation",
        "osm_id": 1,
        "lat": str(shape.centroid.y),
        "lon": str(shape.centroid.x),
        "class": "boundary",
        "importance": importance,
        "display_name": "Kluuvi, Helsinki",
        "boundingbox": [str(south), str(north), str(west), str(east)],
        "geojson": geojson,
    }


PLACES = {
    "Kluuvi, Helsinki": [place(box(WEST, SOUTH, EAST, NORTH))],
    "Helsinki-Kluuvi": [place(box(WEST, SOUTH, EAST, NORTH))],
    "The station": [place({"type": "Point", "coordinates": [24.9414, 60.1713]})],
    "The open sea": [place(box(24.0, 59.5, 24.01, 59.51))],
    "All of Finland": [place(box(20.0, 60.0, 31.0, 70.0))],
    "A bow tie": [place({"type": "Polygon", "coordinates": [[[24, 60], [25, 61], [25, 60], [24, 61], [24, 60]]]})],
}


@cache
def elements():
    """The extract in the JSON of Overpass, by kind and id."""
    found = {"node": {}, "way": {}, "relation": {}}
    for one in ET.fromstring(gzip.decompress(EXTRACT.read_bytes())):
        element = {"type": one.tag, "id": int(one.get("id"))}
        if one.tag == "node":
            element |= {"lat": float(one.get("lat")), "lon": float(one.get("lon"))}
        elif one.tag == "way":
            element["nodes"] = [int(nd.get("ref")) for nd in one.iter("nd")]
        else:
            element["members"] = [
                {"type": m.get("type"), "ref": int(m.get("ref")), "role": m.get("role")} for m in one.iter("member")
            ]
        if tags := {tag.get("k"): tag.get("v") for tag in one.iter("tag")}:
            element["tags"] = tags
        found[one.tag][element["id"]] = element
    return found


@cache
def shape_of(kind, id):
    element = elements()[kind][id]
    if kind == "node":
        return shapely.Point(element["lon"], element["lat"])
    if kind == "way":
        nodes = elements()["node"]
        points = [(nodes[ref]["lon"], nodes[ref]["lat"]) for ref in element["nodes"]]
        return shapely.LineString(points if len(points) > 1 else points * 2)
    members = [m["ref"] for m in element["members"] if m["type"] == "way" and m["ref"] in elements()["way"]]
    return shapely.union_all([shape_of("way", ref) for ref in members])


def suits(tags, filters):
    tests: dict[str, Callable[[str | None, str], bool]] = {
        "": lambda value, _: value is not None,
        "=": lambda value, wanted: value == wanted,
        "!=": lambda value, wanted: value != wanted,
        "~": lambda value, wanted: value is not None and re.search(wanted, value) is not None,
        "!~": lambda value, wanted: value is None or re.search(wanted, value) is None,
    }
    return all(tests[test](tags.get(key), wanted) for key, test, wanted in _FILTER.findall(filters))


def answer_of_overpass(query):
    """The elements that a query asks for, with the nodes and ways that they consist of."""
    wanted = {"node": set(), "way": set(), "relation": set()}
    for kind, filters, outline in _PART.findall(query):
        numbers = [float(number) for number in outline.split()]
        area = shapely.Polygon(list(zip(numbers[1::2], numbers[0::2], strict=True)))
        suiting = [id for id, one in elements()[kind].items() if suits(one.get("tags", {}), filters)]
        wanted[kind] |= {id for id in suiting if area.intersects(shape_of(kind, id))}
    for id in wanted["relation"]:
        members = elements()["relation"][id]["members"]
        wanted["way"] |= {m["ref"] for m in members if m["type"] == "way"} & elements()["way"].keys()
    for id in wanted["way"]:
        wanted["node"].update(elements()["way"][id]["nodes"])
    return {"version": 0.6, "elements": [elements()[kind][id] for kind in wanted for id in sorted(wanted[kind])]}


class Server(ThreadingHTTPServer):
    """Counts the questions; `misbehaviour` maps the end of a path to what happens there."""

    daemon_threads = True
    block_on_close = False

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.asked = []
        self.misbehaviour = {}
        self.places = dict(PLACES)
        self.over = threading.Event()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_port}"

    def answer_to(self, path, given):
        """The data of the answer to a question, when the server behaves."""
        if path.endswith("/search"):
            name = given.get("q") or given.get("city", "")
            return self.places.get(name, [])
        return answer_of_overpass(given["data"])


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self):
        self.reply(urlsplit(self.path).query)

    def do_POST(self):
        self.reply(self.rfile.read(int(self.headers["Content-Length"])).decode())

    def reply(self, text):
        path = urlsplit(self.path).path
        given = {key: values[0] for key, values in parse_qs(text).items()}
        end = path.rsplit("/", 1)[-1]
        self.server.asked.append(end)
        misbehave = self.server.misbehaviour.get(end)
        if misbehave:
            misbehave(self, lambda: self.server.answer_to(path, given))
        elif end == "status":
            send(self, b"no status here", status=404)
        else:
            send(self, json.dumps(self.server.answer_to(path, given)).encode())

    def log_message(self, *args):
        pass


def send(handler, content, status=200, kind="application/json", length=None, headers=()):
    handler.send_response(status)
    handler.send_header("Content-Type", kind)
    handler.send_header("Content-Length", str(len(content) if length is None else length))
    for name, value in headers:
        handler.send_header(name, value)
    handler.end_headers()
    handler.wfile.write(content)


# What a server can do wrong: each takes the handler of a request and a function that makes the right answer.


def hangs(handler, answer):
    handler.server.over.wait(20)


def _repeat(handler, drop, seconds):
    """One drop after the other, until the client hangs up or the test is over."""
    with suppress(OSError):
        while not handler.server.over.wait(seconds):
            handler.wfile.write(drop)


def drips(handler, answer):
    handler.send_response(200)
    handler.send_header("Content-Type", "application/json")
    handler.end_headers()
    _repeat(handler, b" " * 2048, 0.02)


def drips_slowly(handler, answer):
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 900000\r\n\r\n")
    _repeat(handler, b" ", 0.05)


def drips_its_head(handler, answer):
    handler.wfile.write(b"HTTP/1.1 200 OK\r\n")
    _repeat(handler, b"X-Wait: a little\r\n", 0.05)


def hangs_up(handler, answer):
    handler.connection.close()


def is_busy(status, **headers):
    return lambda handler, answer: send(handler, b"<html>Too busy</html>", status, "text/html", headers=headers.items())


def is_busy_once(status):
    busy = [True]

    def reply(handler, answer):
        if busy:
            busy.pop()
            send(handler, b"busy", status)
        else:
            send(handler, json.dumps(answer()).encode())

    return reply


def says(content, status=200, kind="application/json"):
    return lambda handler, answer: send(handler, content, status, kind)


def cuts_its_json(handler, answer):
    content = json.dumps(answer()).encode()
    send(handler, content[: len(content) // 2])


def breaks_off(handler, answer):
    content = json.dumps(answer()).encode()
    send(handler, content[: len(content) // 2], length=len(content))


def changes(change):
    """Answer with the right data after `change(data)`."""

    def reply(handler, answer):
        data = json.loads(json.dumps(answer()))
        change(data)
        send(handler, json.dumps(data).encode())

    return reply


@contextmanager
def serving():
    server = Server()
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.over.set()
        server.shutdown()
        server.server_close()
        thread.join()
