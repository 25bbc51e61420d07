"""A scenario file is changed without losing its comments and its form, or not at all."""

import pytest

from gamms import scenario
from gamms.errors import WriteConflict
from gamms.scenario.edits import Change, edited

TEXT = """\
# A hunt on a grid
map:
  grid: {width: 9, height: 9}   # small
teams:
  red:
    near: [0, 0]  # a corner
    within: 30
    count: 2

  blue:
    agents:
      # the keeper
      - {name: keeper, node: 30}  # at the gate
      - name: rover
        node: 31

rules:
  - {rule: hold, with: {nodes: [7], turns: 5}}
"""


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "hunt.yaml"
    file.write_text(TEXT)
    return file


def lines_after(file, *changes):
    """Return what is different."""
    found = edited(file, changes, scenario.load(file))
    assert file.read_text() == TEXT
    found.write()
    assert scenario.load(file) == found.game
    return [line for line in found.diff.splitlines() if line[0] in "+-" and line[:3] not in ("+++", "---")]


def test_a_value_is_changed_where_it_stands(file):
    assert lines_after(
        file, Change(("teams", "red", "near"), [10.0, 20.0]), Change(("teams", "red", "within"), 45.5)
    ) == [
        "-    near: [0, 0]  # a corner",
        "-    within: 30",
        "+    near: [10.0, 20.0]  # a corner",
        "+    within: 45.5",
    ]


def test_items_are_put_behind_those_that_are_there(file):
    more = [{"name": "blue: 1", "node": {"lat": 60.5, "lon": 24.9}}, {"name": "other", "node": 12}]
    with pytest.raises(scenario.ScenarioError, match="coordinate reference system"):
        edited(file, [Change(("teams", "blue", "agents"), more, is_more=True)], scenario.load(file))
    more[0]["node"] = [10, 10]
    assert lines_after(file, Change(("teams", "blue", "agents"), more, is_more=True)) == [
        '+      - {name: "blue: 1", node: [10, 10]}',
        "+      - {name: other, node: 12}",
    ]


def test_new_keys_stand_behind_the_last_one(file):
    changes = [
        Change(("teams", "red", "agents"), [{"name": "scout", "node": 3}]),
        Change(("map", "closed"), [[[0, 0], [9, 0], [9, 9]]], is_more=True),
    ]
    assert lines_after(file, *changes) == [
        "+  closed: [[[0, 0], [9, 0], [9, 9]]]",
        "+    agents: [{name: scout, node: 3}]",
    ]


def test_values_in_brackets_and_in_blocks_are_changed(file):
    changes = [
        Change(("rules", 0, "with", "nodes"), [1, 2]),
        Change(("teams", "blue", "agents", 0, "node"), 5),
        Change(("teams", "blue", "agents", 1), {"name": "rover", "node": 6}),
    ]
    assert lines_after(file, *changes) == [
        "-      - {name: keeper, node: 30}  # at the gate",
        "-      - name: rover",
        "-        node: 31",
        "+      - {name: keeper, node: 5}  # at the gate",
        "+      -  {name: rover, node: 6}",
        "-  - {rule: hold, with: {nodes: [7], turns: 5}}",
        "+  - {rule: hold, with: {nodes: [1, 2], turns: 5}}",
    ]


def test_what_would_be_wrong_is_not_written(file):
    game = scenario.load(file)
    with pytest.raises(scenario.ScenarioError, match=r"teams\.blue\.agents"):
        edited(file, [Change(("teams", "blue", "agents", 0, "node"), 999)], game)
    for keys in (("teams", "blue", "agents", 2), ("teams", "green", "count")):
        with pytest.raises(scenario.ScenarioError, match="there is nothing to change"):
            edited(file, [Change(keys, 5)], game)
    found = edited(file, [Change(("teams", "red", "within"), 40)], game)
    file.write_text(TEXT + "# another program\n")
    with pytest.raises(WriteConflict, match="another program"):
        found.write()


def test_nothing_is_written_through_a_link(file):
    link = file.with_name("link.yaml")
    link.symlink_to(file)
    found = edited(link, [Change(("teams", "red", "within"), 40)], scenario.load(link))
    with pytest.raises(WriteConflict, match=r"link.yaml is a link, .* Edit .*hunt.yaml"):
        found.write()
    assert file.read_text() == TEXT


def test_a_value_that_others_share_is_left_to_people(tmp_path):
    file = tmp_path / "shared.yaml"
    teams = "  a: {near: &home [0, 0], within: 30, count: 1}\n  b: {near: *home, within: 30, count: 1}\n"
    file.write_text(f"map: {{grid: {{width: 4, height: 4}}}}\nteams:\n{teams}")
    with pytest.raises(scenario.ScenarioError, match="by hand"):
        edited(file, [Change(("teams", "b", "near"), [10, 10])], scenario.load(file))


def test_json_stays_json(tmp_path):
    file = tmp_path / "hunt.json"
    file.write_text(
        '{"map": {"grid": {"width": 4, "height": 4}},\n "teams": {"red": {"count": 1, "near": [0, 0], "within": 9}}}\n'
    )
    found = edited(file, [Change(("teams", "red", "agents"), [{"name": "scout", "node": 3}])], scenario.load(file))
    found.write()
    assert '"within": 9, "agents": [{"name": "scout", "node": 3}]}' in file.read_text()
    assert scenario.load(file) == found.game
