"""Check that graphs and sensors keep their contracts, `gamms.typing.IGraph` and `gamms.typing.ISensor`."""

from collections.abc import Callable
from copy import deepcopy

from gamms.arguments import explain_call_errors
from gamms.errors import BadType
from gamms.text import shown
from gamms.typing import IGraph, ISensor, SensorType
from gamms.typing.sensor_engine import refuse_no_sensor

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
        sensor: a sensor without an owner to keep: the check sets and removes its owner.
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
