"""The option `fog` of visual engines, where it has no effect or a wrong type."""

import logging

import pytest

import gamms


@pytest.mark.parametrize("engine", ["NO_VIS", "OFFSCREEN"])
def test_a_fog_that_pictures_do_not_show_is_logged(engine, caplog):
    with caplog.at_level(logging.WARNING):
        gamms.create_context(vis_engine=engine, vis_kwargs={"fog": "red"}).terminate()
    assert "fog= works in windows only" in caplog.text


@pytest.mark.parametrize("fog", [["red"], 3, b"red", None])
def test_a_fog_that_is_no_team_is_refused(fog):
    with pytest.raises(gamms.errors.BadType, match="fog is True, False or the name of a team"):
        gamms.create_context(vis_engine="PYGAME", vis_kwargs={"fog": fog})
