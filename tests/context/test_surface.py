"""What a user sees of `ctx` and its parts: the names that dir and completion offer."""

import pytest

import gamms
from gamms.compat import FOR_ENGINES, MOVED, OLD_NAMES

PARTS = ("agent", "game", "graph", "record", "sensor", "visual")


@pytest.fixture
def ctx():
    with gamms.create_context() as made:
        yield made


def public(part):
    return {name for name in dir(part) if not name.startswith("_")}


def test_the_parts_of_a_context_show_few_names(ctx):
    sizes = {part: len(public(getattr(ctx, part))) for part in PARTS}
    assert sum(sizes.values()) + len(public(ctx)) <= 190, sizes


@pytest.mark.parametrize("part", sorted({*OLD_NAMES, *FOR_ENGINES}))
def test_names_that_are_not_shown_are_there(ctx, part):
    owner = ctx if part == "ctx" else getattr(ctx, part.removeprefix("ctx."))
    for name in f"{OLD_NAMES.get(part, '')} {FOR_ENGINES.get(part, '')}".split():
        assert hasattr(type(owner), name) or name in vars(owner), name
        assert name not in public(owner)


@pytest.mark.parametrize("old", MOVED)
def test_a_name_that_has_moved_says_where_it_is(ctx, old):
    _, *path, name = old.split(".")
    owner = ctx
    for part in path:
        owner = getattr(owner, part)
    with pytest.raises(AttributeError, match=MOVED[old].replace(".", r"\.")):
        getattr(owner, name)
    found = ctx
    for part in MOVED[old].split(".")[1:]:
        found = getattr(found, part)
