"""Our exceptions: sentences, builtins, and fit to be sent home by a worker."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

import gamms
from gamms import errors

ERRORS = [
    errors.UnknownName("sensor", "nier", ["near"]),
    errors.UnknownType("kind"),
    errors.Duplicate("an agent", "anna"),
    errors.DuplicateId("a node", 3),
    errors.BadValue("value"),
    errors.BadType("type"),
    errors.BadFile("file"),
    errors.MissingExtra("Reading maps", "osm"),
    errors.MissingKey("key"),
    errors.MissingFolder("a.svg", "there"),
    errors.NotYet("it"),
    errors.NotYetImportable("it"),
    errors.NotYetAttribute("it"),
    errors.ContextTerminated("ctx.graph"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_survives_the_way_home(error):
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert type(again) is type(error)
        assert (str(again), again.args) == (str(error), error.args)


def test_an_error_about_an_unknown_name_shows_the_nearest_one_or_all_of_a_few():
    assert (
        str(errors.UnknownName("map", "vridis", ["viridis", "magma"]))
        == "Unknown map 'vridis'. Did you mean 'viridis'?"
    )
    assert (
        str(errors.UnknownName("map", "hot", ["viridis", "magma"]))
        == "Unknown map 'hot'. There are: 'viridis', 'magma'."
    )
    assert str(errors.UnknownName("key", "range", ["fov", "sensor_range"])).endswith("Did you mean 'sensor_range'?")
    reds = [f"red_{number}" for number in range(20)]
    assert str(errors.UnknownName("agent", "red_x", reds[:2])).endswith("Did you mean 'red_0' or 'red_1'?")
    assert str(errors.UnknownName("agent", "red_x", reds)) == (
        "Unknown agent 'red_x'. There are, among others: "
        "'red_0', 'red_1', 'red_2', 'red_3', 'red_4', 'red_5', 'red_6', 'red_7'."
    )


def ask_for_a_missing_node(_):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        return ctx.graph.graph.get_node(99)


def test_a_worker_pool_delivers_our_errors():
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(KeyError, match="Unknown node 99"),
    ):
        list(pool.map(ask_for_a_missing_node, [0]))


@pytest.mark.parametrize("wrong", [3, b"city.gamms", ["city.gamms"]])
def test_an_invalid_path_is_named(wrong):
    calls = [
        lambda ctx: ctx.graph.save(wrong),
        lambda ctx: ctx.graph.load(wrong),
        lambda ctx: ctx.visual.save(wrong),
        lambda _: gamms.create_context(graph_engine=gamms.graph.Engine.SQLITE, graph_path=wrong),
        lambda _: gamms.osm.graph_from_file(wrong),
    ]
    with gamms.create_context() as ctx:
        for call in calls:
            with pytest.raises(errors.BadType, match="path must be a path, not"):
                call(ctx)


def test_a_misspelt_package_has_the_name_that_python_guesses_by():
    with pytest.raises(AttributeError) as caught:
        gamms.strategy  # noqa: B018 - the attribute is asked for
    assert (caught.value.name, caught.value.obj) == ("strategy", gamms)
