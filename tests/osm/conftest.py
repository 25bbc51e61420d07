"""Small maps as text: there is no network in the tests."""

import sys
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for the referee beside

Nodes = dict[int, tuple[float, float]]  # id -> (lat, lon)
MapWay = tuple[list[int], dict[str, str]]  # node ids, tags

CROSS: Nodes = {1: (60.17, 24.940), 2: (60.17, 24.941), 3: (60.17, 24.942), 4: (60.1705, 24.941)}


def map_text(nodes: Nodes, ways: list[MapWay]) -> str:
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
    lines += [f'<node id="{id}" lat="{lat:.7f}" lon="{lon:.7f}"/>' for id, (lat, lon) in nodes.items()]
    for number, (refs, tags) in enumerate(ways, 100):
        inside = [f'<nd ref="{ref}"/>' for ref in refs]
        inside += [f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items()]
        lines.append(f'<way id="{number}">{"".join(inside)}</way>')
    return "\n".join([*lines, "</osm>", ""])


@pytest.fixture
def make_map(tmp_path: Path) -> Callable[..., Path]:
    """A function from nodes and ways to the path of an .osm file."""

    def write(nodes: Nodes, *ways: MapWay, name: str = "map.osm") -> Path:
        path = tmp_path / name
        path.write_text(map_text(nodes, list(ways)), encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def write_map(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A function like `make_map` for tests with many examples."""

    def write(nodes: Nodes, *ways: MapWay) -> Path:
        path = tmp_path_factory.mktemp("maps") / "map.osm"
        path.write_text(map_text(nodes, list(ways)), encoding="utf-8")
        return path

    return write


@pytest.fixture
def cross() -> Nodes:
    """Three nodes in a row along a parallel, 55.6 m apart, and one north of the middle."""
    return dict(CROSS)


@pytest.fixture
def curve() -> Nodes:
    """Nodes along a bend."""
    return {i: (60.17 + 0.00002 * i * i, 24.94 + 0.0003 * i) for i in range(1, 9)}
