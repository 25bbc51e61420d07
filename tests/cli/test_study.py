"""`gamms study FILE`: what it serves, writes, and says of files that are wrong."""

import io
import queue
import re
import signal
import sys
import threading

import httpx
import pytest
from typer.testing import CliRunner

from gamms import cli

MATCH = """
name: The errand
map: {grid: {width: 5, height: 5}}
sensors:
  eyes: {type: AGENT_RANGE, sensor_range: 25}
teams:
  red: {count: 1, sensors: [eyes], strategy: "gamms.strategies:stay"}
  blue: {count: 2, sensors: [eyes], strategy: "gamms.strategies:random_walk"}
max_turns: 4
"""
VISIT = """
scenario: match.yaml
people: red
consent: consent.txt
conditions:
  near: {sensors.eyes.sensor_range: 15}
  far: {sensors.eyes.sensor_range: 45}
rounds: 2
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a study."""
    monkeypatch.chdir(tmp_path)
    for name, text in {"match.yaml": MATCH, "visit.yaml": VISIT, "consent.txt": "Do you agree?\n"}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_study_is_served_until_ctrl_c_and_goes_on(folder, monkeypatch):
    answers = []

    def take_part():
        try:
            agree()
        finally:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    def agree():
        said = ""
        while "#" not in said:  # the link
            said += lines.get(timeout=60.0)
        address, token = re.search(r"(http://127\S+/)\?code=CODE#(\S+)", said).groups()
        with httpx.Client(trust_env=False, headers={"Authorization": f"Bearer {token}"}) as page:
            given = ({"code": "P1"}, {"code": "P1", "secret": "x" * 32, "agree": True})
            answers.extend(page.post(f"{address}participant", json=one).json()["value"] for one in given)

    lines = Lines()
    monkeypatch.setattr(sys, "stdout", lines)
    participant = threading.Thread(target=take_part)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what runs behind them
    participant.start()
    cli.app(["study", "visit.yaml"], standalone_mode=False)
    participant.join()
    signal.signal(signal.SIGINT, before)
    assert answers[0] == {"stage": "consent", "text": "Do you agree?"}
    assert answers[1]["stage"] == "ready"
    assert "visit-results says how many have agreed: 1. The same command goes on." in lines.text
    assert {file.name for file in (folder / "visit-results").iterdir()} == {"study.jsonl", "participants.jsonl"}


class Lines(io.StringIO):
    """A stream whose parts another thread waits for."""

    def __init__(self):
        super().__init__()
        self._parts, self.text = queue.SimpleQueue(), ""

    def write(self, text):
        self.text += text
        self._parts.put(text)
        return len(text)

    def get(self, timeout):
        return self._parts.get(timeout=timeout)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("people: red", "peple: red"), "visit.yaml: unknown key 'peple'. Did you mean 'people'?"),
        (("people: red", "people: reed"), "Unknown team or agent 'reed'. Did you mean 'red'?"),
        (("scenario: match.yaml", ""), "visit.yaml: scenario is missing."),
        (("consent: consent.txt", "consent: 3"), "visit.yaml: consent is the name of a file beside this one, not 3."),
        (("consent.txt", "consnt.txt"), "There is no file 'consnt.txt'. Did you mean 'consent.txt'?"),
        (("consent.txt", "match.yml"), "There is no file 'match.yml'. Did you mean 'match.yaml'?"),
        (("rounds: 2", "rounds: two"), "rounds must be an integer, not 'two'"),
        (("near: {sensors.eyes", "near: {sensors.ears"), "sensors.ears: there is no 'ears' to change."),
        (("near: {sensors.eyes", "near: {sensors.ears"), "In the condition 'near' of the study."),
        (("near: {sensors.eyes.sensor_range: 15}", "near: 15"), "what changes must be a dict, not 15"),
    ],
)
def test_errors_of_study_files_name_the_place(folder, change, sentence):
    (folder / "visit.yaml").write_text(VISIT.replace(*change))
    done = CliRunner().invoke(cli.app, ["study", "visit.yaml"], catch_exceptions=False)
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: ")
    assert sentence in done.stderr
    assert not (folder / "visit-results").exists()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"  \n", "has nothing in it"),
        (b"\xff\xfe", "is not UTF-8"),
        (b" " * 65_537, "has more than 65,536 bytes"),
        (("ä" * 32_769).encode(), "has more than 65,536 bytes"),
    ],
)
def test_a_consent_text_that_cannot_be_read_is_refused(folder, text, sentence):
    (folder / "consent.txt").write_bytes(text)
    done = CliRunner().invoke(cli.app, ["study", "visit.yaml"], catch_exceptions=False)
    assert done.exit_code == 1
    assert f"consent.txt: the consent text {sentence}" in done.stderr
