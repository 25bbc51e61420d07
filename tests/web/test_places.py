"""A page on which places of a map are chosen: found, pointed at, collected, copied; nothing on it becomes markup."""

import json
import re

import pytest
from typer.testing import CliRunner

import gamms
from gamms import scenario, web
from gamms.cli import app
from gamms.errors import BadValue

HOSTILE = "</script><img src=x onerror='window.attacked=true'>"
X, Y = 385_000.0, 6_672_000.0  # in Helsinki

SCENARIO = """\
name: A hunt
seed: 3
map:
  file: town.gamms   # of the town
teams:
  red:
    count: 2
    near: [385020, 6672020]
    within: 30
  blue:
    agents:
      - {name: keeper, node: 30}  # at the gate
rules:
  - {rule: hold, with: {nodes: [7], turns: 5}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the map of a town and a scenario on it."""
    folder = tmp_path_factory.mktemp("town")
    graph = gamms.graph.grid(6, 6, 20.0)
    graph.graph["crs"] = "EPSG:32635"
    for node, data in graph.nodes(data=True):
        data["x"], data["y"] = data["x"] + X, data["y"] + Y
        if node == 7:
            data["note"] = HOSTILE
    for source, target, data in graph.edges(data=True):
        row = source // 6
        data["name"] = HOSTILE if row == 5 else f"Käpytie {row}" if abs(source - target) == 1 else "Crossing"
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        ctx.graph.save(folder / "town.gamms")
    (folder / "hunt.yaml").write_text(SCENARIO)
    return folder


def opened(chromium, folder, source, **window):
    """Open the page of a file."""
    path = folder / "page.html"
    path.write_bytes(web.map_page(folder / source))
    return chromium.open(path, **window)


def pixel_of(page, node):
    """Return where a node is."""
    row = f"gamms.world.rowOf.get({node})"
    return page.value(f"gamms.camera.toScreen(gamms.world.xy[2 * {row}], gamms.world.xy[2 * {row} + 1])")


def test_three_clicks_are_a_scenario_that_loads(chromium, folder):
    page = opened(chromium, folder, "town.gamms")
    for node in (7, 14, 28):
        page.click(*pixel_of(page, node))
    (folder / "copied.yaml").write_text(page.value("document.querySelector('textarea').value"))
    game = scenario.load(folder / "copied.yaml")
    assert {name: nodes.tolist() for name, nodes in game.starts([1]).items()} == {
        "red_0": [7],
        "red_1": [14],
        "red_2": [28],
    }
    page.click(*pixel_of(page, 14))
    assert page.value("gamms.places().map(({id}) => id)") == [7, 28]
    page.call("Input.dispatchKeyEvent", type="keyDown", key="z", modifiers=2)
    assert page.value("gamms.places().map(({id}) => id)") == [7, 14, 28]
    assert page.messages == []


def test_a_street_is_found_without_its_accents_and_flown_to(chromium, folder):
    page = opened(chromium, folder, "town.gamms")
    page.key("/")
    for letter in "kapytie 2":
        page.key(letter)
    assert page.value("document.querySelector('.found').textContent") == "Käpytie 26 nodes+"
    scale = page.value("gamms.camera.scale")
    page.key("Enter")
    page.wait("gamms.flight === null")
    assert page.value("gamms.camera.y") == pytest.approx(Y + 40.0, abs=1.0)
    assert page.value("gamms.camera.scale") != scale
    assert page.value("gamms.street.length") == 5


def test_pointing_at_a_node_describes_it(chromium, folder):
    page = opened(chromium, folder, "town.gamms")
    x, y = pixel_of(page, 7)
    page.mouse("mouseMoved", x + 2, y + 1)
    page.wait("document.querySelector('.tip').textContent")
    words = page.value("document.querySelector('.tip').textContent")
    with gamms.create_context() as ctx:
        ctx.graph.load(folder / "town.gamms")
        lat, lon = ctx.graph.graph.to_latlon(X + 20.0, Y + 20.0)
    for part in ("node 7", "Käpytie 1", f"{lat:.6f}, {lon:.6f}", HOSTILE):
        assert part in words


@pytest.mark.parametrize("kind", ["circle", "polygon"])
def test_an_area_takes_the_nodes_in_it(chromium, folder, kind):
    page = opened(chromium, folder, "hunt.yaml")
    middle, corner = pixel_of(page, 14), pixel_of(page, 21)
    reach = [(b - a) * 1.2 for a, b in zip(middle, corner, strict=True)]
    page.value(f"gamms.panel.{kind}.click()")
    if kind == "circle":
        page.click(*middle)
        page.click(middle[0] + reach[0], middle[1])
        expected = {8, 13, 14, 15, 20}
    else:
        for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)):
            page.click(middle[0] + dx * reach[0], middle[1] + dy * reach[1])
        expected = {7, 8, 9, 13, 14, 15, 19, 20, 21}
    assert set(page.value("gamms.places().map(({id}) => id)")) == expected
    targets = page.value("[...gamms.panel.targets.options].map(({value}) => value)")
    assert targets == [
        "agents red",
        "agents blue",
        "start red",
        "start blue",
        "rule rules.0.with.nodes",
        "closed",
        "list",
    ]


def test_the_starts_of_other_seeds_are_those_of_the_game(chromium, folder):
    page = opened(chromium, folder, "hunt.yaml")
    game = scenario.load(folder / "hunt.yaml")
    assert page.value("gamms.seed") == 3
    for _ in range(2):
        page.value("[...document.querySelectorAll('button')].find((one) => one.textContent == 'Next').click()")
    shown = page.value("gamms.options.starts.seeds[gamms.seed]")
    assert page.value("gamms.seed") == 5
    with game.build(5) as ctx:
        assert shown == [ctx.agent.get_agent(name).current_node_id for name in ("red_0", "red_1", "keeper")]
    page.value("gamms.panel.seed.value = 5000; gamms.panel.seed.dispatchEvent(new Event('input'))")
    assert "not of this one" in page.value("gamms.panel.seedWords.textContent")


@pytest.mark.parametrize("name", ["roads.geojson", "roads.json"])
def test_the_map_of_a_page_may_be_geojson(tmp_path, name):
    roads = {"type": "LineString", "coordinates": [[24.9, 60.2], [24.91, 60.2]]}
    (tmp_path / name).write_text(json.dumps(roads))
    [options] = re.findall(r'id="options">([^<]*)<', web.map_page(tmp_path / name).decode())
    assert json.loads(options)["map"] == {"file": name}


def test_names_of_streets_execute_nothing(chromium, folder):
    page = opened(chromium, folder, "town.gamms", width=390, height=800, touch=True)
    page.value("gamms.panel.search.value = 'script'; gamms.panel.search.dispatchEvent(new Event('input'))")
    assert HOSTILE in page.value("document.querySelector('.found').textContent")
    page.value("document.querySelector('.found .add').click()")
    page.settle()
    assert page.value("window.attacked") is None
    assert page.value("document.images.length") == 0
    assert page.value("document.documentElement.scrollWidth") == 390
    assert page.messages == []


def test_a_page_of_a_map_holds_nothing_as_markup_and_reaches_nothing(folder):
    game = scenario.load(folder / "hunt.yaml").replace(name=HOSTILE + "{data}")
    text = web.map_page(game).decode()
    assert "<img" not in text
    assert text.count("</script>") == 5
    assert "connect-src 'none'" in text
    [options] = re.findall(r'id="options">([^<]*)<', text)
    assert json.loads(options)["title"] == HOSTILE + "{data}"
    with pytest.raises(BadValue, match="'print'"):
        web.map_page(game, theme="print")


@pytest.mark.parametrize("theme", ["light", "dark", None])
def test_a_page_of_a_map_has_the_theme_it_is_given(folder, theme):
    [options] = re.findall(r'id="options">([^<]*)<', web.map_page(folder / "hunt.yaml", theme=theme).decode())
    assert json.loads(options).get("theme") == theme


def test_a_map_command_names_its_page_after_the_file(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["map", str(folder / "hunt.yaml"), "--no-open"])
    assert (done.exit_code, done.output) == (0, "Wrote hunt.html.\n")
    assert (tmp_path / "hunt.html").read_bytes() == web.map_page(folder / "hunt.yaml")
