"""Files are read as plain data, with bounds; what they name is in their folder, or installed."""

import os
import sys
import time
from pathlib import Path

import pytest
import yaml

from gamms import scenario
from gamms.scenario import ScenarioError
from gamms.scenario.documents import parse_json, parse_yaml


@pytest.fixture(params=["CSafeLoader", "SafeLoader"])
def parser(request, monkeypatch):
    """Reads YAML by libyaml, and as where PyYAML comes without it."""
    if request.param == "SafeLoader":
        monkeypatch.delattr(yaml, "CSafeLoader")


@pytest.mark.usefixtures("parser")
def test_an_alias_stands_for_the_value_of_its_anchor():
    assert parse_yaml("a: &x [1, {b: 2}]\nc: {d: *x}\ne: &x 3\nf: *x") == {
        "a": [1, {"b": 2}],
        "c": {"d": [1, {"b": 2}]},
        "e": 3,
        "f": 3,
    }
    assert parse_yaml("&k name: 1\nb: *k") == {"name": 1, "b": "name"}


@pytest.mark.usefixtures("parser")
def test_values_behind_aliases_count_as_often_as_they_are_there():
    bomb = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 30))
    began = time.process_time()
    with pytest.raises(ScenarioError, match="line 7: with its aliases the file has over 500,000 values"):
        parse_yaml(bomb)
    assert time.process_time() - began < 5.0


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a:\n\tb: 1\n", "line 2 begins with a tab. YAML is indented by spaces"),
        ("a:\n  b: 1\n\tc: 2\n", "line 3 begins with a tab"),
        ("a: b: c\n", "line 1, column 5: mapping values are not allowed"),
    ],
)
def test_invalid_yaml_is_reported_by_its_line(text, hint):
    with pytest.raises(ScenarioError) as raised:
        parse_yaml(text)
    assert str(raised.value).startswith(f"this is not YAML: {hint}")
    assert "unicode string" not in str(raised.value)


COLUMN = "Put all keys of a mapping into the same column; a list has items with '- ' only."


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize(
    ("text", "line", "way_out"),
    [
        ("a:\n  b: 1\n c: 2\n", "'c: 2'", COLUMN),
        ("a:\n  b: 1\nc: 2\n   d: 3\n", "'d: 3'", "Put quotes around a text with a colon in it."),
        ("a:\n  b 1\n  c: 2\n", "'c: 2'", "Put a colon and a space after the key in line 2, 'b 1'."),
        ("a:\n  b:1  # one\n  c: 2\n", "'c: 2'", "Put a colon and a space after the key in line 2, 'b:1'."),
        ("a:\n  - b\n  c: 1\n", "'c: 1'", COLUMN),
        ("a: [1, 2\nb: 3\n", "'b: 3'", "Close each bracket, and put a comma between items."),
    ],
)
def test_invalid_yaml_is_reported_with_a_way_out(text, line, way_out):
    with pytest.raises(ScenarioError) as raised:
        parse_yaml(text)
    assert str(raised.value).endswith(f" in {line}. {way_out}")


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a: *x\nb: &x [1]", "line 1: there is no anchor &x before the alias *x."),
        ("a: &a [*a]", "no anchor &a"),
        ("a: 1\nb: {c: 1, c: 2}", "b.c: this key is there twice"),
        ("!!python/object/apply:os.system ['true']", "tag"),
        ("a: !!python/name:os.system", "tag"),
        ("a: !!set {x}", "a: line 1: the tag"),
        ("a: !!binary aGk=", "tag"),
        ("a: !own 3", "tag"),
        ("[" * 3000, "nest"),  # newer versions of libyaml have a limit of their own, and another sentence
        ("a: [1", "not YAML"),
        ("a: 1\n---\nb: 2", "single document"),
        ("a: !!int foo", "invalid literal"),
        ("a: " + "9" * 6000, "a: line 1"),
        ("? [1]\n: 2", "a key must be"),
        ("true: 2", "a key must be"),
        ("a: 1e999", "too large"),
        ("a: \x07", "not YAML"),
        ("a: {18446744073709551616: 1}", "a: line 1: a key that is an integer must fit into 64 bits"),
        ("a: {<<: {b: 1}}", "a: line 1: << is not read"),
        ("? " * 3000, "nested"),
        ("a: &near 1\nb: *naer", "Did you mean 'near'?"),
        ("a: !!float nan_", "could not convert"),
        ("!!map [1]", "tag"),
    ],
)
@pytest.mark.usefixtures("parser")
def test_yaml_that_is_more_than_data_is_refused(text, hint):
    with pytest.raises(ScenarioError, match=r"^") as raised:
        parse_yaml(text)
    assert hint in str(raised.value)


@pytest.mark.parametrize(
    "text",
    [
        "a: {" + ", ".join(f"{(2**61 - 1) * i + 5}: 0" for i in range(10_000)) + "}",  # keys of one hash
        "a: [" + "1," * 112_000 + "1]",
        "a: [" + "{}," * 75_000 + "1]",
        "? " + "k" * 75_000 + "\n: [" + "1," * 75_000 + "1]",
        "a: " + "[" * 450_000,
        '"' + "\\x41" * 100_000 + '": 1',
        "---\n" * 100_000,
        "- " * 200_000,
    ],
    ids=lambda text: text[:12],
)
@pytest.mark.usefixtures("no_collection")
def test_the_time_to_read_a_file_is_bounded_by_its_size(tmp_path, text):
    (tmp_path / "big.yaml").write_text(text)
    begun = time.process_time()
    with pytest.raises(ScenarioError):
        scenario.load(tmp_path / "big.yaml")
    assert time.process_time() - begun < 2.6


@pytest.mark.parametrize(
    "text", ['{"a": 1, "a": 2}', '{"a": NaN}', "[" * 100_000, "{", '{"a": Infinity}', '{"a": 1e999}']
)
def test_json_that_is_no_json_is_refused(text):
    with pytest.raises(ScenarioError):
        parse_json(text)


@pytest.mark.parametrize(
    ("name", "content", "hint"),
    [
        ("big.yaml", b"# " + b"x" * 1_000_000, "1,000,000 bytes"),
        ("odd.yaml", b"\xff\xfe\xfa", "UTF-8"),
        ("list.yaml", b"- 1", "mapping"),
        ("empty.json", b"", "not JSON"),
        ("empty.yaml", b"", "mapping"),
        ("game.txt", b"a: 1", "ends in .yaml, .yml, .json"),
        ("own.yaml", b"folder: /\nmap: {}\nteams: {}", "folder: unknown key"),
        ("numbers.yaml", b"1: 2", "1: unknown key"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused(tmp_path, name, content, hint):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ScenarioError) as raised:
        scenario.load(tmp_path / name)
    assert hint in str(raised.value)
    assert name in str(raised.value)


def test_a_missing_file_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        scenario.load(tmp_path / "none.yaml")


# -- what a file may name ------------------------------------------------------------------------------------------

OUTSIDE = [
    "../outside:run",
    "../outside.py:run",
    "..outside:run",
    "{outside}:run",
    "sub/../../outside.py:run",
    "sub\\..\\..\\outside.py:run",
    "C:\\outside.py:run",
    "link.py:run",
    "link:run",
    "linked/outside.py:run",
    "linked.outside:run",
    "~/outside.py:run",
    "os:system",
    "subprocess:run",
    "__main__:run",
    "builtins:exec",
    ":run",
    "players:",
    "players:a.b",
    "play\0ers.py:run",
]


@pytest.fixture
def outside(folder):
    """A file beside the folder, and ways to it through links."""
    file = folder.parent / "outside.py"
    file.write_text("raise RuntimeError('this was run')\ndef run(state): pass\n")
    (folder / "link.py").symlink_to(file)
    (folder / "linked").symlink_to(folder.parent)
    return file


@pytest.mark.parametrize("reference", OUTSIDE)
def test_code_is_never_taken_from_elsewhere(made, outside, reference):
    text = reference.replace("{outside}", str(outside))
    changes = [{"teams.red.strategy": text}, {"rules.1.rule": text}, {"facts": {"a": [{"function": text}]}}]
    for change in changes if text.count(":") == 1 and text.endswith(":run") else changes[:1]:
        with pytest.raises(ScenarioError):
            made(change).build()


@pytest.mark.parametrize("path", ["../town.osm", "/etc/hostname", "linked/town.osm", "town.osm", "C:/town.osm"])
def test_a_map_is_never_taken_from_elsewhere(made, folder, path):
    (folder.parent / "town.osm").write_text("<osm/>")
    (folder / "linked").symlink_to(folder.parent)
    (folder / "town.osm").symlink_to(folder.parent / "town.osm")
    with pytest.raises(ScenarioError, match=r"^map\.file: .*(leads out|no file)"):
        made(map={"file": path}).check()


def test_a_module_of_the_current_folder_is_not_installed(made, tmp_path, monkeypatch):
    (tmp_path / "stray_module.py").write_text("raise RuntimeError('this was run')\ndef run(state): pass\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ScenarioError, match="neither the folder of the scenario nor installed"):
        made({"teams.red.strategy": "stray_module:run"}).build()
    assert "stray_module" not in sys.modules


def test_loading_and_checking_run_nothing(folder):
    for file in folder.glob("*.py"):
        file.write_text(file.read_text() + "\nraise RuntimeError('this was run')\n")
    one = scenario.load(folder / "little.yaml")
    one.check()
    with pytest.raises(ScenarioError, match=r"teams\.red\.strategy: importing 'players:wander' failed: RuntimeError"):
        one.build()


def test_code_of_two_scenarios_does_not_meet_and_leaves_no_trace(folder, tmp_path):
    other = tmp_path / "others"
    other.mkdir()
    (other / "players.py").write_text("def wander(state):\n    state['action'] = state['curr_pos']\n")
    (other / "referee.py").write_text((folder / "referee.py").read_text())
    (other / "little.yaml").write_text((folder / "little.yaml").read_text())
    before = list(sys.path)
    first, second = (scenario.load(one / "little.yaml").play() for one in (folder, other))
    assert first != second
    assert second.agents["red_0"]["moves"] == 0 < first.agents["red_0"]["moves"]
    assert sys.path == before
    assert not {"players", "referee", "paces"} & set(sys.modules)
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_dir()) == ["games", "others"]


def test_code_that_was_edited_is_imported_again(folder):
    before = scenario.load(folder / "little.yaml").play()
    (folder / "players.py").write_text("def wander(state):\n    state['action'] = state['curr_pos']  # stay\n")
    assert scenario.load(folder / "little.yaml").play() != before


def test_a_scenario_without_a_folder_has_only_installed_code(little):
    with pytest.raises(ScenarioError, match="there is no module 'players' installed"):
        scenario.Scenario(**little).build()
    with pytest.raises(ScenarioError, match="needs folder="):
        scenario.Scenario(map={"file": "a.osm"}, teams={"red": {"count": 1}}).check()


def test_a_folder_may_be_a_link_itself(folder, tmp_path):
    (tmp_path / "shortcut").symlink_to(folder)
    assert scenario.load(tmp_path / "shortcut" / "little.yaml").play().turns == 15


def test_relative_paths_hold_after_a_change_of_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)
    one = scenario.load("little.yaml")
    monkeypatch.chdir(Path(os.sep))
    assert one.play().turns == 15
