"""Wrong arguments are errors at once, which say what to write instead."""

import subprocess
import sys

import pytest

import gamms
from gamms.llm import Strategy
from gamms.visual.captions import write_captions

URL = "http://localhost:1/v1"
WRONG = [
    ({"client": 5}, TypeError, "the address of a server such as"),
    ({"client": None}, ValueError, "give calls="),
    ({"client": "localhost:1"}, ValueError, "The address of a server"),
    ({"model": None}, TypeError, "name of a model must be a string"),
    ({"model": ""}, ValueError, "name of a model must not be empty"),
    ({"instructions": ["a"]}, TypeError, "instructions must be a string"),
    ({"fallback": 5}, TypeError, "fallback must be a function of the state"),
    ({"fallback": gamms.strategies.chase}, TypeError, r"chase makes such a function: call it"),
    ({"template": lambda: "x"}, TypeError, "template must be a function of the state alone"),
    ({"api_key": "sk-1234567890"}, ValueError, "give key_variable, the name of an environment variable"),
    ({"client": None, "calls": "nothing.jsonl"}, FileNotFoundError, "no file 'nothing.jsonl'"),
    ({"calls": "/"}, ValueError, "'/' is a folder"),
    ({"request": {"temperature": float("nan")}}, TypeError, "request must be representable as JSON"),
    ({"seconds": 0}, ValueError, "seconds must be more than 0"),
    ({"attempts": 0}, ValueError, "attempts must be at least 1"),
    ({"at_once": 1.5}, TypeError, "at_once must be an integer"),
    ({"max_calls": -1}, ValueError, "max_calls must not be negative"),
    ({"price_in": -1}, ValueError, "price_in must not be negative"),
    ({"max_cost": 1}, ValueError, "max_cost needs price_in and price_out"),
    ({"constrain": "json"}, ValueError, "constrain must be 'schema' or 'tool' or 'text'"),
    ({"request": {"messages": []}}, ValueError, "request cannot set 'messages'"),
    ({"request": {"seed": {1, 2}}}, TypeError, "request must be representable as JSON"),
    ({"maximum": 1}, KeyError, "Unknown keyword of gamms.llm.Strategy: 'maximum'"),
]


@pytest.mark.parametrize(("given", "kind", "message"), WRONG, ids=[str(i) for i in range(len(WRONG))])
def test_a_wrong_argument_is_an_error_at_once(given, kind, message):
    with pytest.raises(kind, match=message):
        Strategy(**{"client": URL, "model": "m", "instructions": "Go.", **given})


def test_a_wrong_client_is_an_error_at_once():
    import openai

    with pytest.raises(TypeError, match=r"use openai\.AsyncOpenAI"):
        Strategy(openai.OpenAI(api_key="none"), "m", "Go.")
    with pytest.raises(ValueError, match="has its key already"):
        Strategy(openai.AsyncOpenAI(api_key="none"), "m", "Go.", key_variable="KEY")


def test_fields_of_requests_can_be_set_and_left_out():
    settings = Strategy(URL, "m", "Go.", request={"temperature": 0, "max_completion_tokens": 50})._settings
    assert settings.fields == {"temperature": 0, "max_completion_tokens": 50}
    assert settings.longest_answer == 50
    assert Strategy(URL, "m", "Go.", request={"max_tokens": None})._settings.fields == {}


def test_without_the_library_the_error_says_how_to_install_it():
    code = """
import sys
sys.modules["openai"] = None
import gamms
try:
    gamms.llm.Strategy("http://localhost:1/v1", "m", "Go.")
except ImportError as error:
    print(error)
"""
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.startswith("Asking a language model needs an optional library (extra 'llm'): pip install ")


def test_strategies_that_ask_another_one_cannot_await_it():
    with pytest.raises(TypeError, match="must not be an async def"):
        gamms.strategies.first(Strategy(URL, "m", "Go."), gamms.strategies.stay)


def test_films_say_nothing_of_decisions():
    assert write_captions([{"turn": 1, "kind": "llm", "agent": "anna"}]) == []
