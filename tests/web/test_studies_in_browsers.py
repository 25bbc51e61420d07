"""Participants of a study in a real browser: consent, practice, rounds and thanks, alone and in pairs."""

from test_playing_in_browsers import asked, click_middle, place_of
from test_studies import ALONE, DUEL

from gamms import web

WORDS = "document.getElementById('words').textContent"


def begin(page, link, **look):
    """Open the page of a participant, and wait until it says something."""
    has_asked = "document.readyState === 'complete'"  # words may be empty while the page is still read
    return page.open(link, until=f"{has_asked} && {WORDS} !== 'This page needs JavaScript.'", **look)


def go_on(page, words):
    """Wait until the page of the study says something, and press its button, which has the focus, by Enter."""
    page.wait(
        f"document.getElementById('words') && {WORDS}.includes('{words}') && !document.getElementById('go').disabled"
    )
    page.key("Enter", code="Enter", windowsVirtualKeyCode=13, text="\r")


def to_next_round(page):
    """Wait until the game is over, and go back to the page of the study by its button."""
    page.wait("window.gamms && !document.querySelector('.live .wanted').hidden")
    page.wait("document.querySelector('.live .words').textContent === 'This round is over.'")
    click_middle(page, "document.querySelector('.live .wanted')")


def test_a_participant_goes_from_consent_to_thanks_by_mouse_and_keys(chromium, tmp_path):
    given = {"people": "red", "consent": "Do you agree?\n\nYou may stop.", "conditions": {"short": {"max_turns": 1}}}
    given |= {"instructions": "Reach the corner.", "thanks": "Your completion code is C1A7."}
    with web.study(ALONE, out=tmp_path, rounds=1, seconds=60.0, **given) as study:
        begin(chromium, study.link("P1"))
        assert chromium.value(WORDS) == "Do you agree?\n\nYou may stop."
        go_on(chromium, "Do you agree?")
        chromium.wait(f"{WORDS}.includes('Practice round 1. It does not count.\\n\\nReach the corner.')")
        chromium.reload()  # and the same browser goes on
        go_on(chromium, "Practice round 1")
        asked(chromium, 0)
        chromium.click(*place_of(chromium, 1))
        to_next_round(chromium)
        chromium.wait(f"document.getElementById('words') && {WORDS}.includes('Round 1 of 1.\\n\\nReach the corner.')")
        click_middle(chromium, "document.getElementById('go')")
        asked(chromium, 0)
        for key in ("1", "Enter"):
            chromium.key(key)
        with chromium.another(is_other_browser=True) as other:
            begin(other, study.link("P1"))
            assert other.value(WORDS).startswith("This code is used in another browser.")
        to_next_round(chromium)
        chromium.wait(f"document.getElementById('words') && {WORDS} === 'Your completion code is C1A7.'")
        assert chromium.value("document.getElementById('go').hidden")
        assert chromium.messages == []
        rows = study.rows
    assert [(row["practice"], row["choices"], row["missed"]) for row in rows] == [(True, 1, 0), (False, 1, 0)]


def test_two_participants_wait_for_each_other_and_play(chromium, tmp_path):
    with (
        chromium.another(is_other_browser=True) as other,
        web.study(DUEL, consent="Do you agree?", out=tmp_path, practice=0, seconds=60.0) as study,
    ):
        phone = {"width": 390, "height": 844, "touch": True, "dark": True}
        begin(chromium, study.link("P1"))
        go_on(chromium, "Do you agree?")
        chromium.wait(f"{WORDS} === 'Waiting for others to take part, at most 5 minutes. Keep this page open.'")
        begin(other, study.link("P2"), **phone)
        go_on(other, "Do you agree?")
        for page in (other, chromium):
            go_on(page, "with another participant.")
        for page in (chromium, other):
            asked(page, 0)
            here = page.value("gamms.player.question.here")
            click_middle(page, "document.querySelector('.ask .moves button')")
            assert here in (0, 5)
        for page in (chromium, other):
            asked(page, 1)
            page.key("0")
            page.key("Enter")
        for page in (chromium, other):
            to_next_round(page)
            page.wait(f"document.getElementById('words') && {WORDS} === 'You have played all rounds. Thank you.'")
            assert page.messages == []
        rows = study.rows
    assert {(row["participant"], row["partner"], row["choices"]) for row in rows} == {("P1", "P2", 2), ("P2", "P1", 2)}
