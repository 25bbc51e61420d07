"""Check that graphs, sensors and picture formats keep their contracts.

They are `gamms.typing.IGraph`, `gamms.typing.ISensor` and `gamms.visual.backends.Backend`.
"""

from collections.abc import Callable
from copy import deepcopy
from typing import NamedTuple
from xml.etree import ElementTree as ET

from gamms.arguments import explain_call_errors
from gamms.errors import BadType
from gamms.ir.draw import DrawCommands
from gamms.text import shown
from gamms.typing import IGraph, ISensor, SensorType
from gamms.typing.sensor_engine import refuse_no_sensor
from gamms.visual.backends import Backend
from gamms.visual.backends.pillow_backend import decode_pixels
from gamms.visual.camera import Camera
from gamms.visual.drawing import Commands

_NODES = [(1, 0.0, 0.0), (2, 3.0, 4.0), (7, 10.0, 0.0), (5, 0.0, 5.0)]
_EDGES = [(10, 1, 2), (11, 2, 1), (12, 1, 7), (13, 1, 2), (14, 5, 5)]


def check_graph(make: Callable[[], IGraph]) -> None:
    """Check every promise on graphs that `make()` returns empty.

    Raises:
        AssertionError: a promise is broken; the message names it.
        BadType: `make` is not a function.
    """
    if not callable(make):
        raise BadType(f"check_graph takes a function that makes an empty graph, not {shown(make)}.")
    for promise in (_check_answers, _check_refusals, _check_edits, _check_copies_of_input, _check_derived_methods):
        promise(_fill_graph(make()))


@explain_call_errors
def check_sensor(sensor: ISensor, node_id: int) -> None:
    """Check every promise of a sensor that senses from a node.

    Args:
        sensor: a sensor; the check sets an owner, and leaves the sensor without one.
        node_id: a node of the sensor's graph; the world must not change meanwhile.

    Raises:
        AssertionError: a promise is broken; the message names it.
        BadType: `sensor` is not a sensor.
    """
    refuse_no_sensor(sensor)
    expect("sensor_id is a name", str(sensor.sensor_id) == sensor.sensor_id != "", sensor.sensor_id)
    expect("type is a SensorType", isinstance(sensor.type, SensorType), sensor.type)
    expect("sense returns nothing", sensor.sense(node_id) is None, "something")
    first = sensor.data
    kept = deepcopy(first)
    sensor.sense(node_id)
    expect("sensing twice in a world that holds still sees the same", sensor.data == kept, sensor.data)
    expect("data is fresh after every sense", _is_fresh(sensor.data, first), first)
    expect("a later sense changes no earlier result", first == kept, first)
    expect("update accepts a dict", sensor.update({}) is None, "something")
    many = sensor.sense_many([node_id, node_id])
    expect("sense_many looks once for each node", len(many) == 2, len(many))
    expect("sense_many sees the same from the same node", many[0].tolist() == many[1].tolist(), many[1])
    if many.values.dtype == object:
        expect("sense_many sees what sense sees", many[0].tolist() == [kept], many[0])
    try:
        sensor.set_owner("no-agent-yet")
    except KeyError:
        sensor.set_owner(None)  # a sensor may require an existing agent
    expect("set_owner accepts None", sensor.set_owner(None) is None, "something")


def _fill_graph(graph: IGraph) -> IGraph:
    for id, x, y in _NODES:
        graph.add_node({"id": id, "x": x, "y": y})
    for id, source, target in _EDGES:
        graph.add_edge({"id": id, "source": source, "target": target, "length": 5.0})
    return graph


def _check_answers(graph: IGraph) -> None:
    _check_equal("get_nodes() gives all ids in insertion order", list(graph.get_nodes()), [1, 2, 7, 5])
    _check_equal("get_edges() gives all ids in insertion order", list(graph.get_edges()), [10, 11, 12, 13, 14])
    _check_equal("get_nodes(d, x, y) is exact, its rim included", list(graph.get_nodes(5.0, 0.0, 0.0)), [1, 2, 5])
    _check_equal("get_edges(d, x, y) needs one end inside", list(graph.get_edges(1.0, 10.0, 0.0)), [12])
    _check_equal("get_neighbors gives each target once", list(graph.get_neighbors(1)), [2, 7])
    _check_equal("get_neighbors knows self-loops", list(graph.get_neighbors(5)), [5])
    _check_equal("get_node gives the coordinates", tuple(graph.get_node(2)), (2, 3.0, 4.0))
    edge = graph.get_edge(12)
    _check_equal("get_edge gives ends and length", (edge.source, edge.target, edge.length), (1, 7, 5.0))
    _check_equal("a straight edge leads from end to end", list(edge.points), [0.0, 0.0, 10.0, 0.0])


def _check_refusals(graph: IGraph) -> None:
    edge = {"id": 99, "source": 1, "target": 2, "length": 1.0}
    _check_error("add_node of a taken id", KeyError, graph.add_node, {"id": 1, "x": 0.0, "y": 0.0})
    _check_error("add_node without x", ValueError, graph.add_node, {"id": 99, "y": 0.0})
    _check_error("add_node at NaN", ValueError, graph.add_node, {"id": 99, "x": float("nan"), "y": 0.0})
    _check_error("add_node with a text as id", TypeError, graph.add_node, {"id": "a", "x": 0.0, "y": 0.0})
    _check_error("add_edge of a taken id", KeyError, graph.add_edge, {**edge, "id": 10})
    _check_error("add_edge to a missing node", KeyError, graph.add_edge, {**edge, "target": 99})
    _check_error("add_edge without length", ValueError, graph.add_edge, {"id": 99, "source": 1, "target": 2})
    _check_error("get_node of a missing id", KeyError, graph.get_node, 99)
    _check_error("get_edge of a missing id", KeyError, graph.get_edge, 99)
    _check_error("get_neighbors of a missing node, at the call", KeyError, graph.get_neighbors, 99)
    _check_error("update_node without id", ValueError, graph.update_node, {"x": 1.0})
    _check_error("update_edge to a missing node", KeyError, graph.update_edge, {"id": 10, "length": 9.0, "target": 99})
    _check_error("remove_edge of a missing id", KeyError, graph.remove_edge, 99)
    _check_equal("a refused call changes nothing", graph.get_edge(10).length, 5.0)
    _check_answers(graph)


def _check_edits(graph: IGraph) -> None:
    graph.update_node({"id": 7, "x": 20.0})
    _check_equal("update_node keeps what is not given", tuple(graph.get_node(7)), (7, 20.0, 0.0))
    graph.update_edge({"id": 12, "target": 5})
    _check_equal("update_edge moves an end", list(graph.get_neighbors(1)), [2, 5])
    graph.remove_edge(10)
    _check_equal("a parallel edge keeps the neighbour", list(graph.get_neighbors(1)), [5, 2])
    graph.remove_node(2)
    graph.remove_node(2)
    _check_equal("remove_node takes its edges along", list(graph.get_edges()), [12, 14])
    _check_equal("remove_node of a missing node is no error", list(graph.get_nodes()), [1, 7, 5])


def _check_copies_of_input(graph: IGraph) -> None:
    node = {"id": 8, "x": 1, "y": 2, "name": "corner"}
    graph.add_node(node)
    _check_equal("a caller's dict is not changed", node, {"id": 8, "x": 1, "y": 2, "name": "corner"})
    node["x"] = 100
    _check_equal("a caller's dict is not kept", graph.get_node(8).x, 1.0)
    for id in graph.get_nodes():
        graph.remove_node(id)
    _check_equal("a graph may be changed while its ids are read", list(graph.get_nodes()), [])


def _check_derived_methods(graph: IGraph) -> None:
    _check_equal("has_node", [graph.has_node(1), graph.has_node(99)], [True, False])
    _check_equal("neighborhoods begin with the node itself", list(graph.neighborhoods[1]), [1, 2, 7])
    seen = graph.within(1, 5.0)
    _check_equal("within sees the disc, its rim included", list(seen.nodes), [1, 2, 5])
    _check_equal("within sees edges with both ends inside", [edge.id for edge in seen.edges], [10, 11, 13, 14])
    ahead = graph.within(1, 10.0, fov=1.0, heading=(1.0, 0.0))
    _check_equal("within sees the cone and its own node", list(ahead.nodes), [1, 7])
    ids, xy = graph.nodes_near(10.0, 4.0, 4.0)
    _check_equal("nodes_near needs no node at its centre", [ids.tolist(), xy.tolist()], [[7], [[10.0, 0.0]]])
    few = graph.among([5, 2, 1])
    _check_equal("among gives nodes in insertion order", list(few.nodes), [1, 2, 5])
    _check_equal("among gives the edges inside", [edge.id for edge in few.edges], [10, 11, 13, 14])
    _check_error("among of a missing node", KeyError, graph.among, [1, 99])
    _check_equal("positions", graph.positions([7, 1]).tolist(), [[10.0, 0.0], [0.0, 0.0]])
    revision = graph.revision
    graph.update_node({"id": 1, "x": 1.0})
    if revision is not None:
        expect("revision changes with the graph", graph.revision != revision, revision)
    graph.clear()
    _check_equal("clear empties", list(graph.get_nodes()), [])


def _check_equal(promise: str, seen: object, promised: object) -> None:
    expect(f"{promise}: expected {promised!r}", seen == promised, seen)


def _check_error(what: str, kind: type[Exception], call: Callable[..., object], *arguments: object) -> None:
    try:
        call(*arguments)
    except kind:
        return
    except Exception as error:  # any other error of the graph under test is a broken promise
        raise AssertionError(f"{what} must raise {kind.__name__}, not {type(error).__name__}: {error}.") from error
    raise AssertionError(f"{what} must raise {kind.__name__}; nothing was raised.")


def _is_fresh(data: object, before: object) -> bool:
    return data is not before or not isinstance(data, list | dict | set | bytearray)


def expect(promise: str, is_true: bool, seen: object) -> None:
    """Raise AssertionError with the promise and the observed value, unless `is_true`."""
    if not is_true:
        raise AssertionError(f"{promise}: got {seen!r}.")


# -- picture formats --------------------------------------------------------------------------------------------------

_CAMERA = Camera(200, 100, 0.0, 100.0, 1.0)  # the world point (x, y) is pixel (x, 100 - y)
_PAPER = (255, 255, 255, 255)
_TOLERANCE = 6  # of color components: formats may round
_PNG = b"\x89PNG"
_SVG = b"<svg"

_Point = tuple[int, int]
_Rgb = tuple[int, int, int]


class _PictureCase(NamedTuple):
    """A drawing, and its expected pixels in every format."""

    promise: str
    draw: Callable[[Commands], None]
    tag: str  # expected SVG element
    color: _Rgb  # of the painted pixels, over the paper
    painted: tuple[_Point, ...]  # pixels
    free: tuple[_Point, ...]  # pixels


_RING = ((40, 10), (160, 10), (160, 90), (40, 90))  # world units
_HOLE = ((80, 30), (80, 70), (120, 70), (120, 30))
_CORNERS = ((2, 2), (197, 2), (2, 97), (197, 97))
_RED = (200, 0, 0)
_BLUE = (0, 0, 200)
_FAINT = (*_RED, 51)
_PINK = (244, 204, 204)  # a fifth of red over white

_CASES = (
    _PictureCase(
        "a filled circle covers its centre and nothing far outside",
        lambda commands: commands.add_circles([(100, 50)], 20, _RED),
        "circle",
        _RED,
        ((100, 50), (85, 50), (100, 65)),
        ((100, 75), (75, 50), *_CORNERS),
    ),
    _PictureCase(
        "an outlined circle leaves its middle free",
        lambda commands: commands.add_circles([(100, 50)], 20, _RED, 6),
        "circle",
        _RED,
        ((120, 50), (100, 30)),
        ((100, 50), (110, 50), *_CORNERS),
    ),
    _PictureCase(
        "a rectangle hangs from its upper left corner, in pixels",
        lambda commands: commands.add_rectangle(40, 80, 60, 30, _BLUE),
        "rect",
        _BLUE,
        ((42, 22), (97, 47)),
        ((37, 22), (42, 17), (103, 47), (97, 53)),
    ),
    _PictureCase(
        "a polygon is filled",
        lambda commands: commands.add_polygon([(40, 20), (160, 20), (100, 90)], _BLUE),
        "path",
        _BLUE,
        ((100, 40), (60, 76)),
        ((45, 20), (155, 20), (100, 90)),
    ),
    _PictureCase(
        "a polygon with a seam to a ring that runs the other way around has a hole",
        lambda commands: commands.add_polygon([*_RING, _RING[0], *_HOLE, _HOLE[0]], _BLUE),
        "path",
        _BLUE,
        ((60, 50), (100, 20), (140, 50), (100, 80)),
        ((100, 50), (85, 38), (115, 62), *_CORNERS),
    ),
    _PictureCase(
        "a line is as broad as it says",
        lambda commands: commands.add_line([(20, 50), (180, 50)], _RED, 10),
        "path",
        _RED,
        ((30, 50), (100, 47), (170, 52)),
        ((100, 40), (100, 60), *_CORNERS),
    ),
    _PictureCase(
        "transparency is blended",
        lambda commands: commands.add_circles([(100, 50)], 20, _FAINT),
        "circle",
        _PINK,
        ((100, 50),),
        _CORNERS,
    ),
    _PictureCase(
        "a transparent line is blended once where it crosses itself",
        lambda commands: commands.add_lines([(20, 50), (180, 50), (100, 5), (100, 95)], [0, 2, 4], _FAINT, 10),
        "path",
        _PINK,
        ((40, 50), (100, 50), (100, 20)),
        _CORNERS,
    ),
    _PictureCase(
        "a line that crosses the view with both ends outside is seen",
        lambda commands: commands.add_line([(-900, 50), (900, 50)], _RED, 10),
        "path",
        _RED,
        ((2, 50), (197, 50)),
        _CORNERS,
    ),
    _PictureCase(
        "a closed road whose ends are outside is seen",
        lambda commands: commands.add_line([(100, -400), (100, 50), (600, 50), (100, -400)], _RED, 10),
        "path",
        _RED,
        ((100, 80), (150, 50)),
        _CORNERS[:2],
    ),
    _PictureCase(
        "a polygon around the view covers it",
        lambda commands: commands.add_polygon([(-900, -900), (900, -900), (0, 2000)], _BLUE),
        "path",
        _BLUE,
        ((100, 50), *_CORNERS),
        (),
    ),
)


def check_backend(backend: Backend) -> None:
    """Check every promise for a picture format.

    PNG pictures are compared pixel by pixel, SVG pictures element by element; for other formats only general promises
    are checked.

    Args:
        backend: a picture format, as described in `gamms.visual.backends`.

    Raises:
        AssertionError: a promise is broken; the message names it.
    """
    for case in _CASES:
        commands = Commands()
        case.draw(commands)
        picture = _render_picture(backend, commands.freeze())
        if picture.startswith(_PNG):
            _check_pixels(case, picture)
        elif picture.lstrip().startswith(_SVG):
            _check_elements(case, picture)
    _check_layers(backend)
    _check_words(backend)
    _check_distance(backend)


def _render_picture(backend: Backend, commands: DrawCommands) -> bytes:
    def draw() -> object:
        return backend(commands, _CAMERA, title="", background=_PAPER, dpi=96.0)

    picture = draw()
    if not isinstance(picture, bytes) or not picture:
        raise AssertionError(f"a backend returns the bytes of a file: got {type(picture)!r}.")
    expect("the same commands give the same bytes", draw() == picture, "other bytes")
    return picture


def _check_pixels(case: _PictureCase, picture: bytes) -> None:
    pixels = decode_pixels(picture)
    expect("a picture has the size of its camera", pixels.shape == (100, 200, 3), pixels.shape)
    for expected, places in ((case.color, case.painted), (_PAPER[:3], case.free)):
        for x, y in places:
            seen = pixels[y, x]
            is_right = max(abs(int(a) - b) for a, b in zip(seen, expected, strict=True)) <= _TOLERANCE
            expect(f"{case.promise}; pixel ({x}, {y}) should be {expected}", is_right, seen.tolist())


def _check_elements(case: _PictureCase, picture: bytes) -> None:
    root = ET.fromstring(picture)  # noqa: S314 - made a moment ago, by the backend
    tags = [element.tag.rpartition("}")[2] for element in root.iter()]
    wanted = 1 + (case.tag == "rect")  # the paper is a rectangle, too
    expect(f"{case.promise}; <{case.tag}> should be there", tags.count(case.tag) >= wanted, tags)


def _check_layers(backend: Backend) -> None:
    commands = Commands()
    for layer, color in ((20, _RED), (10, _BLUE)):
        commands.layer = layer
        commands.add_circles([(100, 50)], 20, color)
    picture = _render_picture(backend, commands.freeze())
    promise = "higher layers are painted over lower ones"
    if picture.startswith(_PNG):
        seen = decode_pixels(picture)[50, 100].tolist()
        expect(promise, max(abs(a - b) for a, b in zip(seen, _RED, strict=True)) <= _TOLERANCE, seen)
    elif picture.lstrip().startswith(_SVG):
        red, blue = (picture.find("#{:02x}{:02x}{:02x}".format(*color).encode()) for color in (_RED, _BLUE))
        expect(promise, 0 <= blue < red, (blue, red))


def _check_words(backend: Backend) -> None:
    nothing = Commands().freeze()
    words = Commands()
    words.add_text("A <b> & ©", 20, 60, (0, 0, 0), 30)
    blank = _render_picture(backend, nothing)
    expect("text is shown", _render_picture(backend, words.freeze()) != blank, "an empty picture")


def _check_distance(backend: Backend) -> None:
    commands = Commands()
    for x, y in ((1e9, 50.0), (-1e9, -1e9), (100.0, 1e6)):
        commands.add_circles([(x, y)], 20, _RED)
        commands.add_line([(x, y), (x + 10, y)], _RED, 3)
        commands.add_polygon([(x, y), (x + 10, y), (x, y + 10)], _RED)
        commands.add_rectangle(x, y, 10, 10, _RED)
        commands.add_text("far", x, y, _RED, 12)
    picture = _render_picture(backend, commands.freeze())
    if picture.startswith(_PNG):
        expect("what is far away is not seen", bool((decode_pixels(picture) == 255).all()), "something")
