"""What a scenario declares is estimated before it is made, and refused where it would take too much memory."""

import json
import time

import pytest
import yaml
from typer.testing import CliRunner

from gamms import cli, scenario
from gamms.limits import allowing
from gamms.scenario import Scenario, ScenarioError

LINE = {"type": "LineString", "coordinates": [[24.9, 10.0], [24.9, 83.0]]}
ONE = {"type": "Feature", "properties": {"highway": "primary"}, "geometry": LINE}

HUGE = [
    ({"teams.red.count": 10**30}, "teams.red.count: 1000000000000000000000000000000 agents"),
    ({"teams.red.count": 10**4000}, "teams.red.count: <an integer of"),
    ({"teams.red.count": 10_000_000}, "teams.red.count: 10000000 agents would take about 130.4 GiB"),
    ({"teams.red.count": 100_000, "teams.blue.count": 120_000}, "teams.blue.count: 120000 agents"),
    (
        {"map": {"grid": {"width": 3000, "height": 3000}}},
        "map.grid: A grid of 3000 x 3000 nodes would take about 8",
    ),
    ({"map": {"grid": {"width": 10**9, "height": 10**9}}}, "map.grid: A grid of 1000000000 x 1000000000 nodes"),
    ({"map": {"helsinki": {"resolution": 0.05}}}, "map.helsinki: .* m of road in pieces of resolution=0.05 m would"),
    ({"map": {"helsinki": {"resolution": 5e-324}}}, "map.helsinki: .* an astronomical amount"),
    ({"map": {"file": {"path": "line.geojson", "resolution": 0.5}}}, "map.file: .* m of road in pieces of resolution"),
]


@pytest.mark.parametrize(("changes", "message"), HUGE, ids=[str(changes)[:60] for changes, _ in HUGE])
def test_scenarios_too_large_for_memory_are_refused_at_once(folder, little, changes, message):
    (folder / "line.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [ONE]}))
    for path, value in changes.items():
        *way, last = path.split(".")
        here = little
        for part in way:
            here = here[part]
        here[last] = value
    (folder / "huge.yaml").write_text(yaml.safe_dump(little, sort_keys=False))
    begun = time.process_time()
    with pytest.raises(ScenarioError, match=rf"{message}.*--max-memory 8G"):
        scenario.load(folder / "huge.yaml").check()
    assert time.process_time() - begun < 5.0


def test_numbers_that_are_no_count_are_refused(folder):
    text = (folder / "little.yaml").read_text()
    for number, hint in (
        ("1e30", "teams.red.count: cannot be 1e[+]30"),
        ("1e999", "teams.red.count: line .* too large"),
    ):
        (folder / "odd.yaml").write_text(text.replace("count: 3", f"count: {number}"))
        with pytest.raises(ScenarioError, match=hint):
            scenario.load(folder / "odd.yaml")


def test_the_caller_may_allow_more_or_less(little):
    little["teams"]["red"]["count"] = 170_000
    with allowing(8 << 30):
        assert Scenario(**little).spec.teams["red"].count == 170_000
    with pytest.raises(ScenarioError, match=r"GiB of memory; 2\.0 GiB are allowed"):
        Scenario(**little)


@pytest.mark.parametrize("command", [["run"], ["scenario", "check"]])
def test_the_command_line_allows_more_or_less(folder, command, monkeypatch):
    monkeypatch.chdir(folder)  # where `run` writes

    def run(*arguments):
        return CliRunner().invoke(cli.app, [*command, "little.yaml", *arguments])

    file = folder / "little.yaml"
    file.write_text(file.read_text().replace("width: 8", "width: 500"))
    done = run("--max-memory", "2M")
    assert done.exit_code == 1
    assert "map.grid: A grid of 6 x 500 nodes would take" in done.stderr
    assert run("--max-memory", "8G").exit_code == run().exit_code == 0
    done = run("--max-memory", "8 apples")
    assert done.exit_code == 1
    assert "8 apples" in done.stderr
