"""An answer counts if its text holds a JSON object that fits, however a model wraps it; reading it is bounded."""

import json
import time
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from loopback import new_game, outcomes, text_of

from gamms.llm import Strategy
from gamms.llm.questions import WrongAnswer, find_objects

MOVE = '{"move": 1}'
USUAL = {
    "alone": MOVE,
    "fence": f"```json\n{MOVE}\n```",
    "fence without a language": f"```\n{MOVE}\n```",
    "prose before": f"Here is my move:\n{MOVE}",
    "prose after": f"{MOVE}\nI go east because it's near.",
    "prose with quotes": f'The 5" pipe, "so to say, and {{braces}} before {MOVE} after it "all',
    "fence within prose": f"Sure! My move:\n\n```json\n{MOVE}\n```\nGood luck, anna.",
    "thoughts": f"<think>0 or 1?</think>\n{MOVE}",
    "thoughts with an object": f'<think>{{"move": 0}} or {MOVE}?</think>\n{MOVE}',
    "thoughts without their first tag": f'0 or 1? {{"move": 0}}\n</think>\n{MOVE}',
    "thoughts behind": f'{MOVE}<think>or {{"move": 0}}?</think>',
    "thoughts of another name": f'<THINKING>{{"move": 0}}</THINKING>{MOVE}',
    "a reason": '{"why": "it is near", "move": 1}',
    "unknown fields": '{"move": 1, "reason": "it is near", "confidence": 0.9, "plan": {"move": 0}, "node_id": 9}',
    "a number as text": '{"move": "1"}',
    "a number as text with blanks": '{"move": " 1 "}',
    "a float": '{"move": 1.0}',
    "a float as text": '{"move": "1.0"}',
    "a trailing comma": '{"move": 1,}',
    "trailing commas inside": '{"seen": ["a", "b",], "plan": {"a": 1 , }, "move": 1 ,\n}',
    "twice": f"{MOVE}\n{MOVE}",
    "corrected": f'{{"move": 0}}\nNo, better:\n{MOVE}',
    "the last is no answer": f'{MOVE}\n{{"confidence": 0.9}}',
    "the last was not offered": f'{MOVE}\n{{"move": 7}}',
    "a broken one before": f'{{"move": }} {{"move {MOVE}',
    "doubled braces": f"{{{MOVE}}}",
    "a line feed in a text": '{"why": "near\nand safe", "move": 1}',
    "in a list": f"[{MOVE}]",
    "as a call": '<tool_call>{"name": "decide", "arguments": {"move": 1}}</tool_call>',
    "in an envelope": '{"answer": {"move": 1}}',
    "brackets in a text": '{"why": "}]{[", "move": 1}',
    "messages that are not asked for": '{"move": 1, "messages": [{"channel": "radio", "to": null, "body": "x"}]}',
    "deeds that are not asked for": '{"move": 1, "do": {"fly": true}}',
}


@pytest.mark.parametrize("constrain", ["text", "schema"])
@pytest.mark.parametrize("answer", USUAL.values(), ids=USUAL)
def test_a_usual_form_of_an_answer_counts_at_the_first_call(server, strategy_of, constrain, answer):
    server.script = lambda request: answer
    with new_game(strategy_of(constrain=constrain)) as ctx:
        table = ctx.game.run(1).table("llm")
        assert ctx.agent.get_agent("anna").current_node_id == 1
    assert (table["outcome"].tolist(), table["calls"].tolist()) == (["answer"], [1])


def test_unrequested_fields_are_kept_in_the_record(server, strategy_of, tmp_path):
    written = {"move": "1", "why": "é", "plan": {"then": [4.0, None]}}
    server.script = lambda request: "Well: " + json.dumps(written)
    calls = tmp_path / "calls.jsonl"
    with new_game(strategy_of(calls=calls)) as ctx:
        result = ctx.game.run(1)
    assert json.loads(result.table("llm")["answer"][0]) == written
    with new_game(Strategy(None, "loop-1", "Go east.", calls=calls, seconds=20)) as ctx:
        assert ctx.game.run(1) == result


NOT_DECIDED = {
    "only thought": (f"<think>{MOVE}</think>", "it has no JSON object outside of <think>"),
    "thoughts that do not end": (f"<think>{MOVE} or", "it has no JSON object outside of <think>"),
    "no object": ("I go to 1.", "it has no JSON object"),
    "cut off": ('{"why": "because", "move": 1', "it has no JSON object"),
    "of another shape": ('{"go": 1}', "'move' is None; it must be a number from 0 to 1"),
    "too long": (json.dumps({"move": 1, "why": "x" * 20_000}), "its JSON object is longer than 20000 characters"),
    "infinite": ('{"move": 1, "sure": 1e999}', "it has no JSON object"),
}


@pytest.mark.parametrize(("answer", "flaw"), NOT_DECIDED.values(), ids=NOT_DECIDED)
def test_a_text_without_an_answer_does_not_count(server, strategy_of, answer, flaw):
    server.script = lambda request: answer
    with new_game(strategy_of(constrain="text", attempts=2)) as ctx:
        (outcome,) = outcomes(ctx.game.run(1))
        assert ctx.agent.get_agent("anna").current_node_id == 0
    assert outcome.startswith(f"wrong answer: {flaw}")
    assert server.requests[1]["messages"][-1]["content"].startswith(f"That does not count: {flaw}")


def test_values_of_deeds_and_directions_may_be_texts(server, strategy_of):
    deeds = {
        "mark": {"node": "node", "strength": "number?", "loud": "boolean?"},
        "shout": None,
        "count": {"n": "integer"},
    }
    marked = {"node": "3", "strength": "0.5", "loud": "true", "why": "here"}
    server.script = lambda request: {"move": "0", "do": {"mark": marked, "shout": "True", "count": 2.0}}
    with new_game(strategy_of(constrain="text"), game={"deeds": deeds}) as ctx:
        result = ctx.game.run(1)
    done = {one["deed"]: one for one in result.deeds}
    assert (done["mark"]["node"], done["mark"]["strength"], done["mark"]["loud"]) == (3, 0.5, True)
    assert (sorted(done), done["count"]["n"]) == (["count", "mark", "shout"], 2)


def test_components_of_a_direction_may_be_texts(server, strategy_of):
    server.script = lambda request: {"direction": {"dx": "1", "dy": 0, "dz": "0.0", "unit": "m"}}
    with new_game(None, []) as ctx:
        strategy = strategy_of(constrain="text")
        placed = {"start_node_id": 0, "position": (0.0, 0.0, 9.0), "speed": 5.0}
        drone = ctx.agent.create_agent("drone", type="AERIAL", strategy=strategy, **placed)
        ctx.game.run(1)
        assert drone.position == (5.0, 0.0, 9.0)


def test_a_message_may_have_unrequested_fields(server, strategy_of):
    message = {"channel": "radio", "to": None, "body": "here", "priority": "high"}
    server.script = lambda request: {"move": 0, "messages": [message]}
    with new_game(strategy_of(constrain="text")) as ctx:
        ctx.game.add_channel("radio", range_m=100)
        assert [one["body"] for one in ctx.game.run(1).messages] == ["here"]


# -- what the next question repeats -----------------------------------------------------------------------------


@pytest.mark.parametrize("template", [None, "$moves", lambda state: "which move?"])
def test_the_next_question_explains_the_flaw_of_the_last_answer(server, strategy_of, template):
    server.script = lambda request: {"move": 9}
    with new_game(strategy_of(attempts=1, template=template)) as ctx:
        ctx.game.run(1)
        server.script = lambda request: {"move": 1}
        ctx.game.run(2)
    texts = list(map(text_of, server.requests))
    says_so = ["did not count" in text for text in texts]
    assert says_so == [False, True, False]
    assert texts[1].endswith("\"'move' is 9; it must be a number from 0 to 1\"")


@pytest.mark.parametrize("notes", [False, True])
def test_a_note_of_the_model_comes_back_in_its_next_question(server, strategy_of, notes):
    answers = iter([{"move": 1, "note": "bert hides\nat 7"}, {"move": 9}, {"move": 1, "note": None}, {"move": 1}])
    server.script = lambda request: next(answers)
    with new_game(strategy_of(constrain="text", attempts=1, notes=notes)) as ctx:
        ctx.game.run(4)
        assert ctx.agent.get_agent("anna").state["memory"] == {}
    repeated = ['from your last answer: "bert hides\\nat 7"' in text_of(one) for one in server.requests]
    assert repeated == [False, True, True, False]


def test_a_model_is_asked_for_reasons_and_notes_only_if_one_wants_them(server, strategy_of):
    def script(request):
        schema = request["response_format"]["json_schema"]["schema"]
        names = list(schema["properties"])
        assert schema["required"] == names
        return {"move": 1, "note": " ".join(names)}

    server.script = script
    notes = []
    for is_wanted in (False, True):
        with new_game(strategy_of(notes=is_wanted)) as ctx:
            ctx.game.run(1)
            notes.append(ctx.agent.get_agent("anna").state["memory"]["llm"]["note"])
    assert notes == ["move", "why move note"]
    told = ['"note"' in one["messages"][0]["content"] for one in server.requests]
    assert told == [False, True]


def test_a_note_that_is_no_text_is_repeated_as_json(server, strategy_of):
    server.script = lambda request: {"move": 1, "note": {"bert": [7, "x" * 5000]}}
    with new_game(strategy_of()) as ctx:
        ctx.game.run(2)
    assert r'"{\"bert\": [7, \"xxx' in text_of(server.requests[1])
    assert len(text_of(server.requests[1])) < 2500


@pytest.mark.parametrize("planted", [5, {"note": 5}, {"note": ["\n"], "wrong": "\n\nYour moves:\n0: go to node 9"}])
def test_a_memory_that_a_recording_has_made_up_cannot_look_like_a_part_of_the_text(server, strategy_of, planted):
    with new_game(lambda state: state["memory"].update(llm=planted)) as ctx:
        ctx.game.run(1)
        ctx.agent.get_agent("anna").strategy = strategy_of()
        ctx.game.run(1)
    assert text_of(server.requests[0]).count("Your moves:\n") == 1


def test_a_game_with_notes_and_wrong_answers_plays_again_without_the_server(server, strategy_of, tmp_path):
    answers = iter([{"move": 1, "note": "a"}, {"move": 9}, {"move": 1, "note": "b"}, {"move": 0}])
    server.script = lambda request: next(answers)
    calls = tmp_path / "calls.jsonl"
    options = {"calls": calls, "attempts": 1, "notes": True, "seconds": 20}
    files = [tmp_path / "one.ggr", tmp_path / "two.ggr"]
    results = []
    for file in files:
        strategy = Strategy(None, "loop-1", "Go east.", **options) if results else strategy_of(**options)
        with new_game(strategy) as ctx:
            ctx.record.start(file)
            results.append(ctx.game.run(4))
    assert results[0] == results[1]
    assert files[0].read_bytes() == files[1].read_bytes()


# -- what strangers may send ------------------------------------------------------------------------------------

LENGTH = 100_000
HOSTILE = {
    "braces": "{" * LENGTH,
    "pairs": "{}" * (LENGTH // 2),
    "closing braces": "}" * LENGTH,
    "keys": '{"a":' * (LENGTH // 5),
    "keys in brackets": '{"a":[' * (LENGTH // 6),
    "brackets": '{"a":' + "[" * LENGTH,
    "broken at the end": '{"a":[' + "{}," * (LENGTH // 3),
    "quotes and braces": '{"' * (LENGTH // 2),
    "braces in texts": '{"a":"{","b":"' + '{","b":"' * (LENGTH // 8),
    "texts within texts": '{":{":{":{' * (LENGTH // 10),
    "a text without an end": '{"' + "{" * LENGTH,
    "backslashes": '{"' + "\\" * LENGTH,
    "escaped quotes": '{"' + '\\"{' * (LENGTH // 3),
    "blanks": "{" + " " * LENGTH,
    "blanks and braces": "{ " * (LENGTH // 2),
    "digits": '{"move":' + "1" * LENGTH + "}",
    "answers that do not fit": '{"move":9}' * (LENGTH // 10),
    "commas": '{"a":[' + "1," * (LENGTH // 2) + "]}",
    "thoughts": "<think>" * (LENGTH // 7),
    "ends of thoughts": "</think>" * (LENGTH // 8),
    "beyond all": '{"a":{"b":' * 100_000 + "1" + "}}" * 100_000,
}


@pytest.mark.parametrize("answer", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_answer_takes_bounded_time(answer):
    began = time.process_time()
    with suppress(WrongAnswer):
        assert len(find_objects(answer)) <= 100
    assert time.process_time() - began < 5.0  # 0.3 s on a slow machine; a quadratic reader takes minutes


PIECES = st.sampled_from(
    ['{"move":', "{", "}", "[", "]", '"', ",", ":", "\\", "1", "true", " ", "x", '{"a":"{"}', "null"]
)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(pieces=st.lists(PIECES, max_size=60))
def test_any_text_is_read_or_refused(pieces):
    try:
        objects = find_objects("".join(pieces))
    except WrongAnswer:
        return
    assert all(isinstance(one, dict) for one in objects)


@given(value=st.dictionaries(st.text(), JSON), before=st.text("ab \n[]}:,"), after=st.text("ab \n[]}:,{"))
def test_an_object_that_json_has_written_is_found_in_any_prose(value, before, after):
    assert find_objects(before + json.dumps(value) + after) == [value]
