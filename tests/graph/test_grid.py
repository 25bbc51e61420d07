"""Grids: nodes row by row, neighbours joined both ways, ready to be attached."""

import subprocess
import sys

import pytest

import gamms
from gamms.errors import BadType, BadValue, TooLarge
from gamms.graph.networkx_bridge import Grid


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 7), (6, 1), (4, 5)])
def test_a_grid_that_is_attached_without_networkx_is_the_same(open_ctx, tmp_path, n, m):
    for name, made in (("one", Grid(n, m, 7.5)), ("other", gamms.graph.grid(n, m, 7.5))):
        ctx = open_ctx()
        ctx.graph.attach_networkx_graph(made)
        ctx.graph.save(tmp_path / name)
    one, other = tmp_path.iterdir()
    assert one.read_bytes() == other.read_bytes()


def test_the_edges_of_a_grid_have_attributes_of_their_own():
    G = gamms.graph.grid(2, 2)
    G.edges[0, 1]["length"] = 99.0
    assert G.edges[1, 0]["length"] == 10.0


@pytest.mark.parametrize(
    ("arguments", "kind", "hint"),
    [
        ((0, 3), BadValue, "rows must be at least 1, not 0"),
        ((3, -1), BadValue, "columns must be at least 1, not -1"),
        ((2.0, 3), BadType, "rows must be an integer"),
        ((2, True), BadType, "columns must be an integer"),
        ((2, 2, 0), BadValue, "spacing must be more than 0, not 0"),
        ((2, 2, float("inf")), BadValue, "spacing must be finite"),
        ((2, 2, "a"), BadType, "spacing must be a number"),
        ((10**6, 10**6), TooLarge, "A grid of 1000000 x 1000000 nodes would take"),
        ((3000, 3000), TooLarge, "--max-memory"),
    ],
)
def test_an_impossible_grid_is_refused(arguments, kind, hint):
    with pytest.raises(kind, match=hint):
        gamms.graph.grid(*arguments)


def test_a_plain_grid_loads_no_shapely_and_that_of_a_scenario_no_networkx():
    code = (
        "import sys, gamms\n"
        "from gamms.scenario import Scenario\n"
        "Scenario(map={'grid': {'width': 3, 'height': 4}}, teams={'red': {'count': 1}}, max_turns=1).play()\n"
        "assert 'networkx' not in sys.modules\n"
        "with gamms.create_context(logger_config={'level': 'CRITICAL'}) as ctx:\n"
        "    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 4))\n"
        "    assert len(ctx.graph.graph) == 12\n"
        "sys.exit('shapely' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
