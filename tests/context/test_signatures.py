"""What `help`, a notebook and a completion show of the verbs of a context: every keyword that a call accepts."""

import inspect
import re

import pytest

import gamms
from gamms.agent import engine as agents
from gamms.game.channels import Channel
from gamms.sensor.catalog import KINDS, SHARED_KEYWORDS
from gamms.visual import artists

ENGINES = ("agent", "sensor", "visual", "graph", "game", "record")
TAKES_ANY = {  # what becomes an attribute, or is recorded, or is for an engine of another kind
    "agent.create_agent": {"attributes"},
    "game.emit": {"data"},
    "game.publish": {"facts"},
    "record.event": {"data"},
    "visual.create_layer": {"kwargs"},
    "visual.fill_layer": {"kwargs"},
}
ACCEPTED = {
    "agent.create_agent": set(agents._KEYWORDS) - {"meta"},  # an attribute that 1.0.0 named
    "sensor.create_sensor": {*SHARED_KEYWORDS, *(name for kind in KINDS.values() for name in kind.list_names())},
    "visual.set_graph_visual": set(artists._KEYWORDS["graph"]),
    "visual.set_agent_visual": set(artists._KEYWORDS["agent"]) - {"name"},
    "visual.set_sensor_visual": set(artists._KEYWORDS["sensor"]) - {"name"},
    "game.add_channel": set(Channel._fields) - {"name"},
}


def verbs(ctx, *engines):
    """Yield the public methods of engines, by name."""
    for engine in engines:
        part = getattr(ctx, engine)
        for name in dir(type(part)):
            if not name.startswith("_") and callable(method := getattr(part, name)) and inspect.ismethod(method):
                yield f"{engine}.{name}", method


def of_kind(method, kind):
    return {name for name, one in inspect.signature(method).parameters.items() if one.kind is kind}


@pytest.fixture(params=[gamms.visual.Engine.NO_VIS, gamms.visual.Engine.PYGAME])
def ctx(request, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with gamms.create_context(vis_engine=request.param) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        yield ctx


def test_signatures_show_keywords_one_by_one(ctx):
    found = {name: of_kind(method, inspect.Parameter.VAR_KEYWORD) for name, method in verbs(ctx, *ENGINES)}
    assert {name: rest for name, rest in found.items() if rest} == TAKES_ANY


def test_every_keyword_that_a_call_accepts_is_in_its_signature(ctx):
    found = dict(verbs(ctx, *ENGINES))
    assert {name: of_kind(found[name], inspect.Parameter.KEYWORD_ONLY) for name in ACCEPTED} == ACCEPTED


def test_docstrings_explain_every_argument_of_verbs_that_declare_something(ctx):
    declares = re.compile(
        r"\w+\.(create_(?!iter|layer)|set_\w*visual|set_values|add_artist|add_channel|save$|picture|frame|film)"
    )
    for name, method in verbs(ctx, "agent", "sensor", "visual", "game"):
        if declares.match(name):
            explained = re.findall(r"^    (\w+): \S", inspect.getdoc(method), re.MULTILINE)
            assert [one for one in inspect.signature(method).parameters if one not in explained] == [], name


def test_a_default_that_depends_on_other_arguments_is_shown_as_dots(ctx):
    shown = str(inspect.signature(ctx.sensor.create_sensor))
    assert "sensor_range: float = ..., " in shown
    assert "**" not in shown
