"""Where messages go, and from which level on."""

import logging
import os
import subprocess
import sys

import pytest

import gamms
from gamms.sensor import SensorType


def printed_by(code, **env):
    env["PYTHONPATH"] = os.pathsep.join(sys.path)
    run = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    return run.stdout, run.stderr


@pytest.fixture
def level_of(monkeypatch, capfd):
    """The level of a new context in an environment, and what was printed."""

    def level(value, config=None):
        monkeypatch.delenv("GAMMS_LOG_LEVEL", raising=False)
        if value is not None:
            monkeypatch.setenv("GAMMS_LOG_LEVEL", value)
        with gamms.create_context(logger_config=config) as ctx:
            return ctx.logger.level, "".join(capfd.readouterr())

    return level


@pytest.mark.parametrize(
    ("value", "level"),
    [(None, 20), ("DEBUG", 10), ("warning", 30), ("Error", 40), ("CRITICAL", 50), ("loud", 20), ("", 20)],
)
def test_the_environment_names_the_level(level_of, value, level):
    assert level_of(value) == (level, "")  # and nothing is printed


def test_the_environment_of_a_program_names_the_level():
    code = "import gamms; print(gamms.create_context().logger.level)"
    assert printed_by(code, GAMMS_LOG_LEVEL="Error") == ("40\n", "")


def test_the_config_wins_over_the_environment(level_of):
    assert level_of("DEBUG", {"level": "ERROR"}) == (40, "")
    assert level_of("DEBUG", {"level": None})[0] == 10


@pytest.mark.parametrize(("level", "number"), [("ERROR", 40), (35, 35), (gamms.logger.CRITICAL, 50)])
def test_a_level_is_a_name_or_a_number_and_the_callers_dict_is_left_alone(level, number):
    config = {"level": level, "format": "%(message)s"}
    with gamms.create_context(logger_config=config) as ctx:
        assert ctx.logger.level == number
        assert isinstance(ctx.logger, logging.Logger)
        assert isinstance(ctx.logger, gamms.logger.ILogger)
        assert ctx.logger.name == "gamms"
    assert config == {"level": level, "format": "%(message)s"}


@pytest.mark.parametrize("config", [{}, {"format": "%(message)s"}])
def test_a_config_without_a_level_stays_without(config):
    gamms.create_context(logger_config=config).terminate()
    assert "level" not in config


def test_any_key_of_basic_config_works(tmp_path):
    path = tmp_path / "game.log"
    config = f"{{'level': 'INFO', 'filename': {str(path)!r}, 'format': '%(name)s: %(message)s'}}"
    code = f"import gamms; gamms.create_context(logger_config={config}).logger.info('hello')"
    assert printed_by(code) == ("", "")
    assert path.read_text() == "gamms: hello\n"


def test_a_level_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="loud"):
        gamms.create_context(logger_config={"level": "loud"})


def test_the_levels_are_those_of_the_standard_library():
    for name in ("NOTSET", "DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL"):
        assert getattr(gamms.logger, name) == getattr(logging, name)


def test_a_program_may_set_its_own_logger_on_one_context(open_context, listener):
    ctx, other = open_context(), open_context()
    ctx.logger = listener
    ctx.agent.delete_agent("nobody")
    ctx.sensor.create_sensor("s", SensorType.RANGE, sensor_rang=3)
    assert len(listener.heard) == 2
    assert ctx.logger is listener
    assert other.logger is logging.getLogger("gamms")


def test_a_logger_given_to_the_constructor_is_used(listener):
    assert gamms.Context(logger=listener).logger is listener


@pytest.mark.parametrize("logger", [None, "log", object(), print])
def test_what_cannot_log_is_refused(open_context, logger):
    ctx = open_context()
    before = ctx.logger
    with pytest.raises(TypeError, match=r"ILogger.*'debug'"):
        ctx.logger = logger
    assert ctx.logger is before
