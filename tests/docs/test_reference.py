"""The reference of the site has every public name, each with a docstring and an example."""

import ast
import re
import sys
from pathlib import Path

import pytest

import gamms

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import pages

import reference

EXAMPLES = sorted(page.stem for page in pages.EXAMPLES.glob("*.md"))


def test_every_public_name_can_be_found_in_the_source_and_has_a_docstring():
    named = [(package, name) for package in reference.packages() for name in reference.names_of(package)]
    found = {one: reference.found_as(*one) for one in named}
    assert len(named) > 300
    assert not [one for one in named if found[one] is None or not reference.docstring_of(found[one])]


def test_the_reference_has_all_packages_that_completion_offers():
    assert set(reference.packages()) == {"gamms", *(f"gamms.{name}" for name in gamms._MODULES)}
    index = (pages.DOCS / "reference" / "index.md").read_text(encoding="utf-8")
    assert not [package for package in reference.packages() if f"`{package}`" not in index]


def test_an_entry_has_signature_arguments_errors_and_programs():
    page = reference.page_of("gamms.limits")
    for part in ("{py:function} parse_memory(text: str) -> int", "* **estimated**: bytes.", "* **BadValue**: the text"):
        assert part in page
    assert "[Rules](../rules.md)" in reference.examples_of("gamms.rules", "tag")


def test_an_entry_of_a_class_names_its_public_bases():
    _, _, entry = reference.page_of("gamms.errors").partition("{py:class} UnknownName")
    assert "Bases: {py:class}`~gamms.errors.GammsError`, `KeyError`." in entry.partition("{py:class} UnknownType")[0]


def test_each_signature_of_a_function_has_its_module_and_the_last_one_the_text():
    first, _, last = (
        reference.page_of("gamms.strategies")
        .partition("{py:function} mix(p: float, a: gamms.typing.Strategy")[2]
        .partition("::::{py:function} mix(p: float, a: gamms.typing.AerialStrategy")
    )
    assert first.splitlines()[1:] == [":module: gamms.strategies", ":no-index:", "::::", ""]
    assert last.splitlines()[1] == ":module: gamms.strategies"
    assert "Call `a` with probability" in last.partition("\n::::\n")[0]


def test_a_type_that_is_not_public_has_its_module_where_another_one_has_its_name():
    assert "message: gamms.bridge.feeds.Message" in reference.page_of("gamms.bridge")
    assert "agent_engine: gamms.typing.IAgentEngine | None" in reference.page_of("gamms.context")


def test_a_field_is_described_by_all_lines_of_the_text_below_it():
    _, _, entry = reference.page_of("gamms.osm").partition("{py:class} PlaceOptions")
    assert "a node of the map with one of these tags is a\nnode of the graph; ()." in entry


def test_classes_of_fields_have_the_constructor_that_python_makes():
    for package, head in (
        ("gamms.typing", "Node(id: int, x: float, y: float)"),
        ("gamms.typing", "OSMEdge(id: int, source: int, target: int, length: float, linestring: Any=None)"),
        (
            "gamms.osm",
            "Access(speed_kph: float, forward: bool=True, backward: bool=True, backward_kph: float | None=None)",
        ),
        ("gamms.osm", "Mode(*, name: str,"),
        ("gamms.visual", "draw_id: bool=False, edge_line_points: dict[int, Any]=...)"),
    ):
        assert head in reference.page_of(package)


def test_a_verb_of_a_part_is_a_method_of_its_engine():
    _, _, entry = reference.page_of("gamms.visual").partition("{py:class} PictureEngine")
    assert "{py:method} save(path: str | os.PathLike[str]," in entry
    assert "{py:method} add_artist(name: str," in entry


def test_errors_of_several_classes_are_an_item():
    assert "* **UnknownName (KeyError), BadType, BadValue**: the post" in reference.page_of("gamms.strategies")


def test_an_entry_shows_the_example_of_its_name_with_its_output():
    page = reference.page_of("gamms.limits")
    for name, said in (("allowing(", "2048 MiB"), ("parse_memory(", "536870912")):
        _, _, entry = page.partition(f"{{py:function}} {name}")
        assert said in entry.partition("\n::::\n")[0]


@pytest.mark.parametrize("package", EXAMPLES)
def test_a_section_of_examples_names_public_names_that_its_code_uses(package):
    sections = reference.examples_in(package)
    named = [name for names, _ in sections for name in names]
    assert len(named) == len(set(named)), "a name has two sections"
    for names, text in sections:
        unknown = [name for name in names if name not in reference.names_of(package)]
        elsewhere = [name for name in names if name not in unknown and reference.described_in(package, name) != package]
        unused = set(names) - used_in("\n".join(fence.code for fence in pages.fences_in(text)))
        assert (unknown, elsewhere, unused) == ([], [], set())


def test_every_public_name_has_an_example_or_a_page_that_uses_it():
    named = [(package, name) for package in reference.packages() for name in reference.names_of(package)]
    described = [one for one in named if reference.described_in(*one) == one[0]]
    assert len(described) > 300
    assert not [one for one in described if not reference.examples_of(*one)]


def used_in(code):
    """Return the names that code uses; importing one is no use."""
    nodes = list(ast.walk(ast.parse(code)))
    loaded = {node.id for node in nodes if isinstance(node, ast.Name)}
    return loaded | {node.attr for node in nodes if isinstance(node, ast.Attribute)}


def test_a_page_has_an_entry_for_each_name_of_its_package():
    for package in reference.packages():
        page, names = reference.page_of(package), reference.names_of(package)
        assert not [
            name for name in names if not re.search(rf"\}} \S*\b{name}\b|^\* `{name}`: see", page, re.MULTILINE)
        ]
