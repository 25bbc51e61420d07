"""A scenario file may name a language model, if the one who reads it allows that."""

import pytest
from loopback import KEY, outcomes
from typer.testing import CliRunner

import gamms
from gamms.cli import app
from gamms.scenario import ScenarioError

ALLOWED = {"allow": ["gamms.llm"], "key_variable": "LOOPBACK_KEY"}


def file_of(folder, address, **more):
    given = {"client": address, "model": "loop-1", "instructions": "Go.", **more}
    lines = "".join(f"        {key}: {value}\n" for key, value in given.items())
    text = (
        "max_turns: 2\nmap: {grid: {width: 6, height: 1}}\nteams:\n  red:\n    count: 2\n    strategy:\n"
        f"      function: gamms.llm:Strategy\n      with:\n{lines}"
    )
    (folder / "game.yaml").write_text(text)
    return folder / "game.yaml"


def test_a_scenario_is_played_and_shares_its_limits(server, tmp_path):
    file = file_of(tmp_path, server.url, max_calls=3)
    scenario = gamms.scenario.load(file, **ALLOWED)
    result = scenario.play(seed=1, record=tmp_path / "game.ggr")
    assert outcomes(result).count("answer") == 3
    assert scenario.play(seed=1) == result
    assert scenario.check()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert KEY not in str(recording.header)
        assert gamms.scenario.from_recording(recording, **ALLOWED).play(seed=1) == result


def test_no_server_is_asked_unless_that_is_allowed(server, tmp_path):
    file = file_of(tmp_path, server.url)
    scenario = gamms.scenario.load(file)
    for use in (scenario.check, scenario.play):
        with pytest.raises(
            ScenarioError, match=r"teams\.red\.strategy: 'gamms\.llm' sends what agents know.*--allow gamms\.llm"
        ):
            use()
    gamms.scenario.load(file, **ALLOWED).play(seed=1, record=tmp_path / "game.ggr")
    server.requests.clear()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording, pytest.raises(ScenarioError, match="allow"):
        gamms.scenario.from_recording(recording).play()
    assert server.requests == []


def test_only_the_strategy_may_be_named(server, tmp_path):
    file = file_of(tmp_path, server.url)
    file.write_text(file.read_text().replace("gamms.llm:Strategy", "gamms.llm:connect"))
    with pytest.raises(ScenarioError, match="no function 'connect'"):
        gamms.scenario.load(file, **ALLOWED).play()
    with pytest.raises(ValueError, match="cannot be allowed"):
        gamms.scenario.load(file, allow=["gamms"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"key_variable": "LOOPBACK_KEY"}, r"with\.key_variable: a file names no environment variable.*--key-variable"),
        ({"calls": "../calls.jsonl"}, r"with\.calls: '\.\./calls\.jsonl' leads out of the folder"),
        ({"calls": "elsewhere.jsonl"}, r"with\.calls: 'elsewhere\.jsonl' leads out of the folder"),
        ({"api_key": KEY}, "give key_variable, the name of an environment variable"),
        ({"calss": "x"}, "Did you mean 'calls'"),
        ({"max_cost": 1}, "max_cost needs price_in and price_out"),
    ],
)
def test_errors_in_a_file_are_named_without_a_key(server, tmp_path_factory, given, message):
    tmp_path = tmp_path_factory.mktemp("game")
    (tmp_path / "elsewhere.jsonl").symlink_to(tmp_path.parent / "calls.jsonl")
    with pytest.raises(ScenarioError, match=message) as raised:
        gamms.scenario.load(file_of(tmp_path, server.url, **given), **ALLOWED).play()
    assert KEY not in str(raised.value)
    assert not (tmp_path.parent / "calls.jsonl").exists()


def test_decisions_are_stored_in_the_folder_of_the_scenario(server, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    gamms.scenario.load(file_of(tmp_path, server.url, calls="calls.jsonl"), **ALLOWED).play(seed=1)
    assert (tmp_path / "calls.jsonl").exists()
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_fallback_finds_its_file_in_the_folder_and_nowhere_else(server, tmp_path):
    policy = '{function: "gamms.rl:policy", with: {path: ../red.safetensors}}'
    with pytest.raises(ScenarioError, match=r"fallback\.with\.path: .* leads out of the folder"):
        gamms.scenario.load(file_of(tmp_path, server.url, fallback=policy), **ALLOWED).play()


def test_the_key_is_named_on_the_command_line(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = ["run", str(file_of(tmp_path, server.url)), "--allow", "gamms.llm", "--key-variable", "LOOPBACK_KEY"]
    done = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert {headers["authorization"] for headers in server.headers} == {f"Bearer {KEY}"}
