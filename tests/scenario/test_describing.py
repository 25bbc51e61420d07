"""Descriptions of scenarios by the ODD protocol, and the differences between two scenarios."""

import re

import pytest
from typer.testing import CliRunner

from gamms import cli, scenario
from gamms.errors import BadType
from gamms.ir.schema import Audience
from gamms.scenario import Scenario
from gamms.scenario.describing import _get_texts, as_page
from gamms.scenario.spec import list_keys, list_mappings
from gamms.text import parse_entries, split_paragraphs

SECTIONS = [
    "## 1 Purpose and patterns",
    "## 2 Entities, state variables, and scales",
    "## 3 Process overview and scheduling",
    "## 4 Design concepts",
    "## 5 Initialization",
    "## 6 Input data",
    "## 7 Submodels",
    "## 8 Keys of the scenario",
]
WALK = {
    "name": "Walk",
    "seed": 4,
    "max_turns": 9,
    "map": {"grid": {"rows": 4, "columns": 5}},
    "sensors": {"eyes": {"type": "AGENT_RANGE", "range_m": 20, "detection": 0.5}},
    "teams": {
        "red": {"count": 2, "strategy": "gamms.strategies:random_walk", "sensors": ["eyes"]},
        "blue": {"agents": [{"name": "anna", "node": 3}, {"name": "bert"}]},
    },
    "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}, "last_team"],
}
CODE = '''
"""A module that is not run."""
raise RuntimeError("this was run")


def wander(state):
    """Walk where nobody has been.

    Args:
        state: the state.
    """


def ring(size, *, gap=3):
    """Return a ring of streets."""
'''


def walk(**changes):
    return Scenario(**WALK).replace(**changes)


def unescaped(text):
    return re.sub(r"\\([\\`*_\[\]<>|#~&])", r"\1", text)


# -- the ODD protocol ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scenario.gallery())
def test_every_game_of_the_gallery_is_described_with_every_key_of_the_schema(name):
    game = scenario.from_gallery(name)
    text = unescaped(game.describe())
    places = [text.index(section) for section in SECTIONS]
    assert places == sorted(places)
    for part, content in scenario.schema()["$defs"].items():
        section = text[text.index(f"\n### Keys of {part}\n") :].partition("\n\n### ")[0]
        rows = re.findall(r"^\| (\S+) \| (.*) \| (.+) \| (.+) \|$", section, re.MULTILINE)
        assert [row[0] for row in rows[1:]] == list(content["properties"]), part
    for code in game.code():
        assert f": {code.text}\n" in text
    for team in game.spec.teams:
        assert f"\n| {team} | " in text


def test_every_key_has_a_meaning_and_no_text_is_without_a_key():
    for kind in list_mappings():
        texts = _get_texts(kind)
        assert all(texts.get(key) for key in list_keys(kind)), kind
        assert set(parse_entries(kind.__doc__)) <= set(list_keys(kind)), kind


def test_the_map_the_starts_and_the_random_draws_are_in_the_description():
    game = walk()
    text = unescaped(game.describe())
    assert "| nodes | 20 |" in text
    assert f"| SHA-256 of streets and obstacles | {game.digests()['map']} |" in text
    starts = {name: int(nodes[0]) for name, nodes in game.starts([4]).items()}
    assert f'| red | {{"red_0": {starts["red_0"]}, "red_1": {starts["red_1"]}}} |' in text
    assert "| reports of sensors | sensors.eyes.detection |" in text
    assert "| 1 | tag | after | Make a rule that lets each tagger tag one agent" in text
    assert "| hops | null | default | maximum number of edges between agents" in text
    assert "| give way | agents that lose conflicts stay |" in text
    assert "game is played for at most 9 turns" in text
    assert game.describe() == walk().describe()


def test_state_variables_have_a_meaning_and_say_who_knows_of_changes():
    section = unescaped(walk().describe()).partition("### State variables\n")[2].partition("\n### ")[0]
    rows = re.findall(r"^\| (agent|game) \| (\S+) \| (.+) \| (.+) \|$", section, re.MULTILINE)
    known = {name: who for _, name, _, who in rows}
    assert {name for name, who in known.items() if "fixed" in who} == {"names", "numbers", "kind", "mode"}
    assert known["position"] == known["current_node_id"] == known["progress"] == Audience.SENSED.value
    assert known["strategies"] == Audience.HOST.value
    assert all(meaning.strip() for _, _, meaning, _ in rows)


def test_code_of_users_is_read_and_not_run(tmp_path):
    (tmp_path / "players.py").write_text(CODE)
    changes = {"teams.red.strategy": "players:wander", "map": {"generator": {"function": "players:ring"}}}
    raw = {**walk(**{"teams.red.strategy": "players:wander"}).to_dict(), "map": changes["map"]}
    game = Scenario(**raw, folder=tmp_path)
    text = game.describe()
    assert "### teams.red.strategy: players:wander\n\nWalk where nobody has been.\n" in text
    assert "Return a ring of streets." in text
    assert "| not loaded | The map is made by code or a server." in text
    assert re.search(r"\| players.py \| [0-9a-f]{64} \|", text)
    with pytest.raises(scenario.ScenarioError, match="this was run"):
        game.describe(build=True)


def test_maps_that_code_makes_are_described_if_they_are_built():
    game = scenario.from_gallery("patrol")
    assert game.digests()["map"] in game.describe(build=True)


def test_no_text_lets_a_description_run_code():
    with pytest.raises(BadType, match="build must be True or False, not 'no'"):
        scenario.from_gallery("grid_tag").describe(build="no")


def test_texts_of_a_scenario_are_no_markup():
    nasty = "<script>alert(1)</script> | `x` [a](javascript:b) # **c**\n# d"
    game = walk(name=nasty, description=nasty, data={nasty: nasty})
    text = game.describe()
    assert f"# {nasty.splitlines()[0]}" not in text
    assert "# d: model" not in unescaped(text).splitlines()
    page = as_page(text, nasty)
    assert "<script" not in page
    assert "<a " not in page
    assert "default-src 'none'" in page
    for table in re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE):
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(widths) == 1, table


def test_docstrings_are_read_by_sections():
    docs = """Do it
    well.

    More `words`.

    Args:
        first: one: two
            and three.
        a, b: both.

    Raises:
        BadValue: never.
    """
    assert split_paragraphs(docs) == ["Do it well.", "More `words`."]
    assert parse_entries(docs) == {"first": "one: two and three.", "a": "both.", "b": "both."}
    assert (split_paragraphs(None), parse_entries(None)) == ([], {})


# -- differences --------------------------------------------------------------------------------------------------


def test_differences_are_named_by_their_keys():
    other = walk(**{"teams.red.count": 3, "map": {"grid": {"rows": 4, "columns": 5, "spacing": 12}}})
    assert walk().differences(other) == ["map.grid.spacing: 10.0, and 12.0", "teams.red.count: 2, and 3"]


def test_a_default_is_no_difference_to_the_same_value():
    assert walk().differences(walk(**{"settings.legal": "edges", "teams.red.apart": 0.0})) == []


def test_items_of_lists_are_compared_by_their_names_and_their_order():
    raw = walk().to_dict()
    raw["teams"]["blue"]["agents"] = [{"name": "bert"}, {"name": "carl"}, {"name": "anna", "node": 4}]
    found = walk().differences(Scenario(**raw))
    assert found[0] == "teams.blue.agents.anna.node: 3, and 4"
    assert found[1].startswith('teams.blue.agents.carl: not there, and {"type": null')
    assert found[2] == "teams.blue.agents: in the order anna, bert, and bert, anna"
    raw["teams"]["blue"] = WALK["teams"]["blue"]
    raw["rules"].reverse()
    assert walk().differences(Scenario(**raw)) == ["rules: in the order tag, last_team, and last_team, tag"]


def test_values_in_lists_are_compared_by_their_places():
    other = walk(data={"at": [1.5, 2.5], "posts": [4, 5, 6]})
    assert walk(data={"at": [1.5, 3.5], "posts": [4, 6]}).differences(other) == [
        "data.at.1: 3.5, and 2.5",
        "data.posts.1: 6, and 5",
        "data.posts.2: not there, and 6",
    ]


def test_numbers_and_truths_differ():
    assert walk(data={"a": 1}).differences(walk(data={"a": True})) == ["data.a: 1, and true"]
    with pytest.raises(BadType, match="differences needs another Scenario, not 3"):
        walk().differences(3)


# -- the commands -------------------------------------------------------------------------------------------------


def run(*words):
    return CliRunner().invoke(cli.app, ["scenario", *map(str, words)], catch_exceptions=False)


def test_the_commands_describe_and_compare_files(folder, monkeypatch):
    monkeypatch.chdir(folder)
    text = (folder / "little.yaml").read_text()
    assert "## 7 Submodels" in run("describe", "little.yaml").stdout
    assert run("describe", "little.yaml", "--format", "odd", "--out", "little.html").exit_code == 0
    assert (folder / "little.html").read_text().startswith("<!doctype html>")
    assert "There is no format 'odt'. Did you mean 'odd'?" in run("describe", "little.yaml", "--format", "odt").stderr
    assert "A description is a .md or .html file" in run("describe", "little.yaml", "--out", "little.pdf").stderr
    (folder / "other.yaml").write_text(f"{text}\ndescription: another\n")
    same = run("diff", "little.yaml", "little.yaml")
    assert (same.exit_code, same.stdout) == (0, "little.yaml and little.yaml are the same scenario.\n")
    different = run("diff", "little.yaml", "other.yaml")
    assert (different.exit_code, different.stdout) == (1, 'description: "", and "another"\n')
