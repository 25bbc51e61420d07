"""Any programme gives the same results and the same errors on every store."""

import math

from hypothesis import given
from hypothesis import strategies as st

from gamms.memory import MemoryStore, PathLike, SqliteStore

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**65), 2**65)
    | st.floats()
    | st.text(alphabet=st.characters(codec=None), max_size=4)
    | st.binary(max_size=3)
)
KEYS_INSIDE = SCALARS.filter(lambda value: value == value)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(KEYS_INSIDE | st.tuples(KEYS_INSIDE), inner, max_size=3)
        | st.frozensets(KEYS_INSIDE, max_size=3)
        | st.sets(KEYS_INSIDE, max_size=3)
    ),
    max_leaves=6,
)
KEY_TYPES = [int, float, str, bool, bytes]
TYPES = st.sampled_from([int, float, str, bool, bytes, tuple, list, dict, set, frozenset])
MAPS = st.sampled_from(["m", "M", "order by", "unknown"])
FIELDS = st.sampled_from(["id", "ID", "a b", "x"])
KEYS = st.sampled_from([0, 1, 1.0, True, "a", "A", b"a", -0.0, None, 2**63, math.nan])
ROWS = st.dictionaries(FIELDS, KEYS | TREES, max_size=4)
STEPS = (
    st.tuples(st.just("create_map"), MAPS, st.dictionaries(FIELDS, TYPES, max_size=4), FIELDS)
    | st.tuples(st.sampled_from(["delete_map", "query_keys"]), MAPS)
    | st.tuples(st.sampled_from(["get_data", "delete_data"]), MAPS, KEYS)
    | st.tuples(st.sampled_from(["insert_data", "update_data"]), MAPS, ROWS)
    | st.tuples(st.just("list_maps"))
)


def outcome(store, step):
    """What the call gives, with types and the sign of zero, or the class and text of its error."""
    try:
        result = getattr(store, step[0])(*step[1:])
    except Exception as error:  # noqa: BLE001 - the error is the result
        return type(error), str(error)
    return spelt(list(result) if step[0] == "query_keys" else result)


def spelt(value):
    if isinstance(value, dict):
        return [(spelt(key), spelt(one)) for key, one in value.items()]
    if isinstance(value, (set, frozenset)):
        return type(value), sorted(repr(spelt(one)) for one in value)
    if isinstance(value, (list, tuple)):
        return type(value), [spelt(one) for one in value]
    return repr(value)


VALUES = {
    int: st.integers(-3, 3),
    float: st.floats() | st.integers(-3, 3),
    str: st.text(max_size=2),
    bool: st.booleans(),
    bytes: st.binary(max_size=1),
    tuple: st.lists(TREES, max_size=2).map(tuple),
    list: st.lists(TREES, max_size=2),
    dict: st.dictionaries(KEYS_INSIDE, TREES, max_size=2),
    set: st.sets(KEYS_INSIDE, max_size=2),
    frozenset: st.frozensets(KEYS_INSIDE, max_size=2),
}


def compare(programme):
    stores = MemoryStore("s"), SqliteStore("s", PathLike(":memory:"))
    try:
        for step in programme:
            assert outcome(stores[0], step) == outcome(stores[1], step)
        for name in stores[0].list_maps():
            keys = [list(store.query_keys(name)) for store in stores]
            assert spelt(keys[0]) == spelt(keys[1])
            for key in keys[0]:
                assert outcome(stores[0], ("get_data", name, key)) == outcome(stores[1], ("get_data", name, key))
    finally:
        for store in stores:
            store.close()


@given(st.lists(STEPS, max_size=12))
def test_any_programme_gives_the_same_on_every_store(programme):
    compare(programme)


@st.composite
def sound_programmes(draw):
    """Mostly valid calls on one map, so that rows pile up."""
    schema = draw(st.dictionaries(FIELDS, TYPES, min_size=1, max_size=3)) | {"key": draw(st.sampled_from(KEY_TYPES))}
    value = {name: VALUES[kind] for name, kind in schema.items()}
    row = st.fixed_dictionaries(value)
    part = st.fixed_dictionaries(
        {"key": value["key"]}, optional={name: one for name, one in value.items() if name != "key"}
    )
    step = (
        st.tuples(st.sampled_from(["insert_data", "update_data"]), st.just("m"), row | part)
        | st.tuples(st.sampled_from(["get_data", "delete_data"]), st.just("m"), value["key"])
        | st.tuples(st.just("query_keys"), st.just("m"))
    )
    return [("create_map", "m", schema, "key"), *draw(st.lists(step, max_size=15))]


@given(sound_programmes())
def test_a_sound_programme_gives_the_same_on_every_store(programme):
    compare(programme)


@given(TREES)
def test_what_is_stored_is_what_comes_back(tree):
    for store in (MemoryStore("s"), SqliteStore("s", PathLike(":memory:"))):
        store.create_map("m", {"id": int, "tree": list}, "id")
        kept = outcome(store, ("insert_data", "m", {"id": 1, "tree": [tree]}))
        if kept == "None":
            assert spelt(store.get_data("m", 1)["tree"]) == spelt([tree])
        store.close()
