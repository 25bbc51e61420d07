"""Recordings whose texts control terminals, and whose integers Python refuses to write out, in every field."""

import io
import logging
import re
from contextlib import suppress

import hostile
import numpy as np
import pytest
from typer.testing import CliRunner

import gamms
from gamms import cli, recorder
from gamms.errors import GammsError
from gamms.ir import events as kinds

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\u202e\u2066\ud800ü"
HUGE = 1 << 20_000
SEEN = {"agents": np.array([0]), "counts": np.array([0])}


def look(keywords):
    """What a header says of the look of an agent."""
    spec = {"name": "anna", "kind": "agent", "keywords": keywords, "layer": 30, "visible": True}
    return {"visuals": {"artists": [spec], "is_declared": False}}


FIELDS = {
    "the name of an agent": lambda v: hostile.recording([[]], {"names": [v]}),
    "a team": lambda v: hostile.recording([[]], {"teams": [v]}),
    "a speed": lambda v: hostile.recording([[]], {"speed": [v]}),
    "a strategy": lambda v: hostile.recording([[]], {"strategies": [v]}),
    "attributes": lambda v: hostile.recording([[]], {"attributes": {0: {"a": v}}}),
    "the name of an attribute": lambda v: hostile.recording([[]], {"attributes": {0: {v: 1}}}),
    "a score": lambda v: hostile.recording([[]], {"scores": [("red", v)]}),
    "whose score": lambda v: hostile.recording([[]], {"scores": [(v, 1)]}),
    "scores": lambda v: hostile.recording([[]], {"scores": v}),
    "a score in an event": lambda v: hostile.recording([[(kinds.GAME_SCORES, {"scores": [(v, v)]})]]),
    "data": lambda v: hostile.recording([[]], {"data": {"a": v}}),
    "a key of data": lambda v: hostile.recording([[(kinds.GAME_DATA, {"set": {v: {v}}})]]),
    "a removed key": lambda v: hostile.recording([[(kinds.GAME_DATA, {"more": {v: [v]}, "removed": [v]})]]),
    "a memory": lambda v: hostile.recording([[]], {"memories": {v: {v: v}}, "team_memories": [(v, {v: v})]}),
    "the winner": lambda v: hostile.recording([[(kinds.GAME_OVER, {"reason": v, "winner": v})]]),
    "the end": lambda v: hostile.recording([[(kinds.GAME_OVER, {v: v})]]),
    "the turn": lambda v: hostile.recording([[]], {"turn": v}),
    "the count": lambda v: hostile.recording([[(kinds.GAME_TURN, {"turn": v, "pace": v})]]),
    "chance": lambda v: hostile.recording([[]], {"chance": v}),
    "a fact": lambda v: hostile.recording([[(kinds.GAME_FACTS, {"set": {v: v}, "removed": [v]})]]),
    "the kind of an event": lambda v: hostile.recording([[(kinds.USER_EVENT, {"kind": v})]]),
    "an event": lambda v: hostile.recording([[(kinds.GAME_EVENT, {"kind": "a", "turn": 1, "b": {v: (v, {v})}})]]),
    "an event without a turn": lambda v: hostile.recording([[(kinds.GAME_EVENT, {"kind": "a", "b": v})]]),
    "the turn of an event": lambda v: hostile.recording([[(kinds.GAME_EVENT, {"kind": "a", "turn": v})]]),
    "a new agent": lambda v: hostile.recording([[(kinds.AGENT_CREATE, {"name": v, "kwargs": {"start_node_id": 0}})]]),
    "where an agent starts": lambda v: hostile.recording([[hostile.created("b", v)]]),
    "what an agent has": lambda v: hostile.recording(
        [[(kinds.AGENT_CREATE, {"name": "b", "kwargs": {"start_node_id": 0, "sensors": [v], "b": v, "type": v}})]]
    ),
    "who goes": lambda v: hostile.recording([[hostile.deleted(v)]]),
    "who changes the team": lambda v: hostile.recording([[hostile.team_of(v)]]),
    "a new team": lambda v: hostile.recording([[hostile.team_of("anna", v)]]),
    "the name of a sensor": lambda v: hostile.recording(
        [[(kinds.AGENT_SENSOR_REGISTER, {"agent_name": "anna", "name": v, "sensor_id": "near"})]]
    ),
    "an unknown sensor": lambda v: hostile.recording(
        [[(kinds.AGENT_SENSOR_REGISTER, {"agent_name": "anna", "name": "b", "sensor_id": v})]]
    ),
    "the type of a sensor": lambda v: hostile.recording(
        [[(kinds.SENSORS, {"sensor_kinds": [{"type": v, "keywords": {}, "ids": [v]}]})]]
    ),
    "a keyword of a sensor": lambda v: hostile.recording(
        [
            [
                (
                    kinds.SENSORS,
                    {"sensor_kinds": [{"type": "AGENT_RANGE", "keywords": {"sensor_range": v}, "ids": ["a"]}]},
                )
            ]
        ]
    ),
    "a component": lambda v: hostile.recording(
        [[(0x02000000, {"key": ["m", "C"], "struct": {"a": "int"}}), (0x02000001, {"name": v, "type": ["m", "C"]})]]
    ),
    "a class": lambda v: hostile.recording([[(0x02000000, {"key": ["m", v], "struct": {"a": v}})]]),
    "the package": lambda v: hostile.recording([[]], header={"package": v}),
    "the provenance": lambda v: hostile.recording([[]], header={"provenance": {v: v}}),
    "the seed": lambda v: hostile.recording([[]], header={"seed": v}),
    "the time": lambda v: hostile.recording([[]], header={"created": v}),
    "the hash of the map": lambda v: hostile.recording([[]], header={"world_sha256": v}),
    "the visuals": lambda v: hostile.recording(
        [[]],
        header={"visuals": {"artists": [{"name": v, "kind": v, "keywords": {v: v}, "layer": v, "visible": v}]}},
    ),
    "the name of an agent that looks otherwise": lambda v: hostile.recording([[]], header=look({"name": v})),
    "how an agent looks": lambda v: hostile.recording(
        [[]], header=look({"name": "anna", "color": v, "size": v, "image_path": v})
    ),
    "what was sensed": lambda v: hostile.recording([[(kinds.SENSED, SEEN | {"sensors": [(v, v)], "which": v})]]),
}


def commands(path, folder):
    other = folder / "other.ggr"
    other.write_bytes(hostile.recording([[]], {"teams": ["other"]}))
    yield from (["info", path], ["info", "--json", path], ["verify", path], ["replay", path], ["diff", path, other])
    yield ["convert", path, folder / "out.jsonl"]
    yield ["render", path, folder / "out.html"]
    for name in ("out.svg", "out.png"):
        yield ["render", path, folder / name, "--width", "80", "--height", "60"]


@pytest.mark.parametrize("made", FIELDS.values(), ids=FIELDS.keys())
@pytest.mark.parametrize("value", [EVIL, HUGE], ids=["codes", "digits"])
def test_commands_print_readable_text_and_no_tracebacks(made, value, tmp_path, caplog):
    path = tmp_path / "game.ggr"
    path.write_bytes(made(value))
    for command in commands(path, tmp_path):
        result = CliRunner().invoke(cli.app, list(map(str, command)), catch_exceptions=False)
        assert result.output
        assert "Traceback" not in result.output, command
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]", result.output), (
            command
        )


@pytest.mark.parametrize("made", FIELDS.values(), ids=FIELDS.keys())
def test_programs_get_errors_of_our_own(made):
    data = made(HUGE)

    def opened(ask):
        with suppress(GammsError), recorder.open(io.BytesIO(data)) as recording:
            ask(recording)

    for ask in (
        list,
        lambda found: list(found.events()),
        lambda found: list(found.steps()),
        lambda found: found.resume(1).terminate(),
        lambda found: found.observation(1, "anna"),
        *(lambda found, name=name: found.table(name) for name in ("events", "moves", "positions", "scores", "sensed")),
    ):
        opened(ask)


@pytest.mark.parametrize("value", [np.arange(3), [1], {"a": 1}], ids=["array", "list", "dict"])
def test_a_keyword_of_an_artist_that_is_no_scalar_ends_in_a_sentence(value, tmp_path):
    path = tmp_path / "game.ggr"
    for keywords in ({"name": value}, {"name": "anna", "size": value, "color": value, "image_path": value}):
        path.write_bytes(hostile.recording([[]], header=look(keywords)))
        result = CliRunner().invoke(cli.app, ["render", str(path), str(tmp_path / "out.svg")])
        assert "Traceback" not in result.output


def test_log_lines_have_no_control_characters(caplog):
    with gamms.create_context() as ctx, caplog.at_level(logging.WARNING, "gamms"):
        ctx.logger.warning("Agent %s is gone", EVIL)
    assert "\x1b" not in caplog.text
    assert r"Agent \u001b]0;owned\u0007" in caplog.text


def test_many_rows_are_cut_short(tmp_path):
    path = tmp_path / "game.ggr"
    path.write_bytes(hostile.recording([[]], hostile.crowd(600)))
    result = CliRunner().invoke(cli.app, ["replay", str(path)], catch_exceptions=False)
    assert "agent_499 " in result.output
    assert "agent_500 " not in result.output
    assert "and 100 more" in result.output


@pytest.mark.parametrize("number", [5.0, True, "5", None, -1, 0, 1 << 70], ids=str)
def test_a_replay_refuses_a_number_for_the_next_agent_that_is_none(number):
    data = hostile.recording([[]], {"next": number})
    for version in (2, 3):
        with gamms.create_context() as ctx:
            ctx.record.start(io.BytesIO(), version=version)
            with pytest.raises(recorder.RecordingError, match="cannot"):
                list(ctx.record.replay(io.BytesIO(data)))


@pytest.mark.parametrize("kind", [np.arange(3), None, 5, ["a"]], ids=str)
def test_a_replay_refuses_events_whose_kind_is_no_text(kind):
    for data in (
        hostile.recording([[(kinds.GAME_EVENT, {"kind": kind, "turn": 1})]]),
        hostile.recording([[]], {"events": [{"kind": kind}]}),
    ):
        with gamms.create_context() as ctx, pytest.raises(recorder.RecordingError, match="it has no kind"):
            list(ctx.record.replay(io.BytesIO(data)))
