"""The one door to osmium: read the roads of a map file, whatever its format and the order of its parts."""

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from gamms.errors import BadFile, MissingExtra
from gamms.limits import Allowance
from gamms.osm.files import WAY_OUT, allowance_of, file_format
from gamms.osm.travel import OSMType
from gamms.osm.ways import Ways, is_against, is_open_to, kept_tags, traffic_rule

if TYPE_CHECKING:
    from collections.abc import Callable

_DEGREE = 10_000_000  # osmium counts in units of 1e-7 degrees
_NOWHERE = 2**31 - 1
BYTES_PER_POINT = 1_000  # of memory, from the file to the graph
_SHOW_EVERY = 4096  # ways


class _Columns:
    """Ways while they are being read."""

    def __init__(self, osm_type: OSMType | None, allowance: Allowance) -> None:
        self.osm_type, self.allowance = osm_type, allowance
        self.offsets, self.refs = array("q", (0,)), array("q")
        self.x, self.y = array("q"), array("q")
        self.against = array("b")
        self.tags: list[dict[str, Any]] = []
        self.osmids: set[int] = set()

    def add(self, way: Any) -> None:
        tags = {tag.k: tag.v for tag in way.tags}
        if way.deleted or way.id in self.osmids or not is_open_to(self.osm_type, tags):
            return
        self.allowance.charge(BYTES_PER_POINT * len(way.nodes))
        for node in way.nodes:
            place = node.location
            self.refs.append(node.ref)
            self.x.append(place.x)
            self.y.append(place.y)
        self.offsets.append(len(self.refs))
        self.against.append(is_against(traffic_rule(self.osm_type, tags)))
        self.tags.append(kept_tags(way.id, tags, self.osm_type))
        self.osmids.add(way.id)

    def ways(self) -> Ways:
        units = np.column_stack((np.array(self.x, np.int64), np.array(self.y, np.int64)))
        outside = np.any(np.abs(units) > (180 * _DEGREE, 90 * _DEGREE), axis=1)
        lonlat = units / _DEGREE
        lonlat[outside] = np.nan
        refs, offsets = np.array(self.refs, np.int64), np.array(self.offsets, np.int64)
        return Ways(offsets, refs, lonlat, np.array(self.against, np.bool_), self.tags)


def read_ways(file: Path, show: "Callable[[str], None]", osm_type: OSMType | None = None) -> Ways:
    """The roads of a map file for one way of moving, or for any, in its order.

    Raises:
        BadFile: it is not OpenStreetMap data, damaged, too large, or has no roads.
        MissingExtra: osmium is not installed.
    """
    source = source_of(file)
    columns = _Columns(osm_type, allowance_of(file))
    show(f"Reading {file.name}")
    with errors_of(file):
        for count, way in enumerate(_road_ways(source)):
            columns.add(way)
            if count % _SHOW_EVERY == _SHOW_EVERY - 1:
                show(f"Reading {file.name}: {count} roads")
        missing = _missing(columns)
        if missing:
            show(f"Reading {file.name}: looking for {len(missing)} nodes")
            _find(columns, places_of(source, missing))
    if not columns.tags:
        whose = "" if osm_type is None else f" for {osm_type}"
        _refuse(
            file, f"it has no roads{whose}, that is no such ways with a highway tag. Export the area with its roads."
        )
    return columns.ways()


def source_of(file: Path) -> Any:
    """A map file for osmium to open.

    Raises:
        BadFile: it is empty, of another kind, damaged, or expands absurdly.
        MissingExtra: osmium is not installed.
    """
    try:
        import osmium
    except ImportError as error:
        raise MissingExtra("Reading OpenStreetMap files", "osm") from error
    return osmium.io.File(str(file), file_format(file))


def _road_ways(source: Any) -> Iterator[Any]:
    from osmium import FileProcessor, osm
    from osmium.filter import EntityFilter, KeyFilter

    objects = FileProcessor(source, osm.NODE | osm.WAY).with_locations()
    return iter(objects.with_filter(EntityFilter(osm.WAY)).with_filter(KeyFilter("highway")))


def _missing(columns: _Columns) -> set[int]:
    return {ref for ref, x in zip(columns.refs, columns.x, strict=True) if x == _NOWHERE}


def places_of(source: Any, wanted: set[int]) -> dict[int, tuple[int, int]]:
    """Where these nodes are: osmium itself finds neither nodes that follow their way nor negative ids."""
    from osmium import FileProcessor, osm

    nodes: Iterator[Any] = iter(FileProcessor(source, osm.NODE))
    return {node.id: (node.location.x, node.location.y) for node in nodes if node.id in wanted}


def _find(columns: _Columns, places: dict[int, tuple[int, int]]) -> None:
    for position, (ref, x) in enumerate(zip(columns.refs, columns.x, strict=True)):
        if x == _NOWHERE and ref in places:
            columns.x[position], columns.y[position] = places[ref]


@contextmanager
def errors_of(file: Path) -> Iterator[None]:
    """Whatever osmium says about a file, say it with the name of the file and the way out."""
    from osmium import InvalidLocationError

    try:
        yield
    except BadFile:
        raise
    except (RuntimeError, ValueError, MemoryError, OverflowError, InvalidLocationError) as error:
        raise BadFile(f"{str(file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error


def _refuse(file: Path, why: str) -> NoReturn:
    raise BadFile(f"{str(file)!r} cannot be used: {why}")
