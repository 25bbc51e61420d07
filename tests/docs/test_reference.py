"""The reference of the site has every public name, each with a docstring."""

import sys
from pathlib import Path

import gamms

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import pages
import reference


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


def test_a_page_has_an_entry_for_each_name_of_its_package():
    package = "gamms.rules"
    page = reference.page_of(package)
    assert not [name for name in reference.names_of(package) if f" {name}" not in page and f"`{name}`" not in page]
