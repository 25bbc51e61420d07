"""The buildings of the map that comes with GAMMS."""

import zlib
from importlib.resources import files

import numpy as np
import pytest

import gamms
from gamms.graph.map_file import load

QUIET = {"level": "CRITICAL"}
ROADS = 333840139  # checksum


def test_the_roads_are_those_of_the_file_before_it_had_buildings():
    columns = load(str(files("gamms") / "data" / "helsinki.gamms")).columns
    arrays = [columns.xy, columns.sources, columns.targets, columns.lengths, *columns.polylines.values()]
    assert zlib.crc32(b"".join(array.astype(array.dtype.newbyteorder("<")).tobytes() for array in arrays)) == ROADS


def test_after_an_error_neither_streets_nor_buildings_are_left():
    with gamms.create_context(logger_config=QUIET) as ctx:
        with pytest.raises(ValueError, match="resolution"):
            gamms.osm.helsinki(ctx, resolution=0.0, buildings=True)
        assert list(ctx.graph.get_obstacle_faces()) == []
        assert len(gamms.osm.helsinki(ctx, resolution=50.0, buildings=True)) > 2500


def test_a_picture_shows_each_type_in_its_colour(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        gamms.osm.helsinki(ctx, resolution=50.0, buildings=True)
        ctx.visual.set_obstacle_visual()
        ctx.visual.save(tmp_path / "helsinki.svg")
        svg = (tmp_path / "helsinki.svg").read_text(encoding="utf-8")
        types = np.unique(ctx.graph.obstacle_columns().types)
        assert all(f'stroke="{gamms.osm.constants.COLOR_TYPES[type]}"' in svg for type in types.tolist())
