"""Games for pages, and one browser for all tests that look at them."""

import asyncio
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import pytest

import gamms

sys.path.insert(0, str(Path(__file__).parent))
import browser

# uvicorn looks every tenth of a second whether it is to end, and each of the tests' many servers would wait for two.
with suppress(ImportError):
    import uvicorn.server

    uvicorn.server.asyncio = ModuleType("asyncio")
    vars(uvicorn.server.asyncio).update(vars(asyncio), sleep=lambda seconds: asyncio.sleep(seconds / 10))


@pytest.fixture(scope="session")
def started():
    """One page of a headless Chromium, which is used again by all tests."""
    if browser.CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    with browser.browser() as page:
        yield page


@pytest.fixture(scope="module")
def chromium(started):
    """That page, which is blank after the tests of a file: what plays there would go on while others run."""
    yield started
    started.call("Page.navigate", url="about:blank")


def walk(state):
    """Go around."""
    state["action"] = state["legal"][state["turn"] % len(state["legal"])]


@pytest.fixture(scope="session")
def game(tmp_path_factory):
    """A recording of two teams on a grid, with scores, tags and what was sensed."""
    path = tmp_path_factory.mktemp("game") / "game.ggr"
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
        eyes = ctx.sensor.create_sensor("eyes", gamms.sensor.SensorType.AGENT_RANGE, sensor_range=15.0)
        for number, (team, node) in enumerate((("red", 0), ("red", 3), ("blue", 35), ("blue", 30))):
            sensors = {"eyes": eyes.sensor_id}
            ctx.agent.create_agent(f"{team}_{number}", start_node_id=node, team=team, sensors=sensors, strategy=walk)

        @ctx.game.add
        def score(ctx):
            ctx.game.scores["red"] = ctx.game.turn // 10
            if ctx.game.turn == 12:
                ctx.game.emit("storm", agent="red_0")

        ctx.record.start(path, sensed=True)
        ctx.game.run(max_turns=80)
    return path
