"""The values that collectors of the games have collected, in every turn of an experiment."""

import json

import pytest
from small_hunts import HUNT

from gamms import experiment
from gamms.errors import BadFile, UnknownName
from gamms.scenario import Scenario

COLLECTING = """
def watch(ctx):
    pass

def prepare(ctx):
    ctx.game.collect("where", lambda agent: agent.current_node_id, per="agent", every=2)
    ctx.game.collect("events", lambda ctx: {"count": len(ctx.game.events)})

watch.prepare = prepare
"""
COUNTS = {"teams.red.count": [1, 2]}


@pytest.fixture
def watched(tmp_path):
    """Return a hunt with two collectors."""
    folder = tmp_path / "scenario"
    folder.mkdir()
    (folder / "watching.py").write_text(COLLECTING)
    plain = HUNT.to_dict()
    return Scenario(**{**plain, "rules": [*plain["rules"], "watching:watch"]}, folder=str(folder))


def as_lists(series):
    return {name: values.tolist() for name, values in series.items()}


def test_a_series_has_the_values_of_the_results_of_games(watched):
    rows = experiment.run(watched, range(3), COUNTS)
    expected = {"id": [], "turn": [], "agent": [], "value": []}
    for row in rows:
        table = rows.play(row["id"]).collected["where"]
        expected["id"] += [row["id"]] * len(table["turn"])
        for name, values in table.items():
            expected[name] += values
    assert as_lists(rows.series("where")) == expected
    assert set(rows.series("where")["turn"].tolist()) <= {2, 4, 6}
    events = as_lists(rows.series("events"))
    assert len(events["value"]) == sum(row["turns"] for row in rows)
    assert max(one["count"] for one in events["value"]) > 0
    assert set(events["agent"]) == {None}
    with pytest.raises(UnknownName, match=r"Unknown collector 'wher'\. Did you mean 'where'"):
        rows.series("wher")


def test_series_in_a_folder_are_the_same_resumed_in_processes_and_in_shards(watched, tmp_path, pool):
    here = experiment.run(watched, range(4), COUNTS, out=tmp_path / "here")
    data = (tmp_path / "here" / "series.jsonl").read_bytes()
    experiment.run(watched, range(4), COUNTS, out=tmp_path / "there", executor=pool)
    assert (tmp_path / "there" / "series.jsonl").read_bytes() == data
    for number in (1, 2):
        experiment.run(watched, range(4), COUNTS, out=tmp_path / "parts", shard=(number, 2))
    experiment.merge(tmp_path / "parts")
    assert (tmp_path / "parts" / "series.jsonl").read_bytes() == data
    journal = tmp_path / "here" / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:3]) + lines[3][:20])  # as a killed run leaves it
    with (tmp_path / "here" / "series.jsonl").open("ab") as file:
        file.write(b'{"id": "torn')
    again = experiment.run(watched, range(4), COUNTS, out=tmp_path / "here")
    assert (tmp_path / "here" / "series.jsonl").read_bytes() == data
    assert as_lists(again.series("events")) == as_lists(here.series("events"))
    assert as_lists(experiment.load(tmp_path / "here").series("where")) == as_lists(here.series("where"))


def test_an_experiment_without_collectors_writes_no_series(tmp_path):
    rows = experiment.run(HUNT, [1], out=tmp_path)
    assert not (tmp_path / "series.jsonl").exists()
    with pytest.raises(UnknownName, match="Unknown collector 'any'"):
        rows.series("any")


def test_a_series_whose_columns_differ_in_length_is_refused(watched, tmp_path):
    rows = experiment.run(watched, [1], out=tmp_path / "out")
    file = tmp_path / "out" / "series.jsonl"
    line = json.loads(file.read_text().splitlines()[0])
    file.write_text(json.dumps({**line, "turn": [1, 2, 3, 4]}) + "\n")
    with pytest.raises(BadFile, match=r"series 'where' of the row .* differ in length"):
        rows.series("where")
    file.write_text('{"id": "x", "name": "where", "turn": 3, "value": []}\n')
    with pytest.raises(BadFile, match="line 1"):
        rows.series("where")
