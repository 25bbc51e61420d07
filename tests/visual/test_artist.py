"""An artist: what can be set, and what is refused."""

import pytest

from gamms.errors import BadType
from gamms.typing import ArtistType, IArtist
from gamms.visual import Artist, RenderMode, Shape
from gamms.visual.drawers import render_circle


def draw_nothing(ctx, data):
    """Draw nothing."""


def test_an_artist_starts_visible_dynamic_and_on_layer_30(ctx):
    artist = Artist(ctx, drawer=draw_nothing)
    assert isinstance(artist, IArtist)
    assert artist.get_layer() == 30
    assert artist.get_visible() is True
    assert artist.get_artist_type() is ArtistType.DYNAMIC
    assert artist.get_drawer() is draw_nothing
    assert artist.data == {}


def test_a_shape_names_a_drawer(ctx):
    assert Artist(ctx, Shape.Circle).get_drawer() is render_circle


def test_everything_can_be_changed(ctx):
    artist = Artist(ctx, draw_nothing, layer=3)
    artist.set_layer(7)
    artist.set_visible(False)
    artist.set_drawer(Shape.Circle)
    artist.set_artist_type(ArtistType.STATIC)
    artist.set_render_mode(RenderMode.CACHED)
    assert artist.get_layer() == 7
    assert artist.get_visible() is False
    assert artist.get_drawer() is render_circle
    assert artist.get_artist_type() is ArtistType.STATIC
    assert artist.get_render_mode() is RenderMode.CACHED


def test_drawing_hands_over_the_context_and_the_data_of_the_moment(ctx):
    seen = []
    artist = Artist(ctx, lambda *arguments: seen.append(arguments))
    artist.data = {"turn": 3}
    artist.draw()
    assert seen == [(ctx, {"turn": 3})]


def test_a_layer_is_dirty_from_its_change_to_the_next_drawing(ctx):
    artist = Artist(ctx, draw_nothing)
    artist.set_layer(30)
    assert not artist.layer_dirty
    artist.set_layer(31)
    assert artist.layer_dirty
    artist.draw()
    assert not artist.layer_dirty


@pytest.mark.parametrize(
    "wrong",
    [
        lambda ctx: Artist(ctx, "circle"),
        lambda ctx: Artist(ctx, draw_nothing, layer=1.5),
        lambda ctx: Artist(ctx, draw_nothing).set_layer("top"),
        lambda ctx: Artist(ctx, draw_nothing).set_drawer(None),
        lambda ctx: Artist(ctx, draw_nothing).set_artist_type(1),
        lambda ctx: Artist(ctx, draw_nothing).set_render_mode(1),
    ],
)
def test_a_wrong_type_is_refused(ctx, wrong):
    with pytest.raises(BadType):
        wrong(ctx)
