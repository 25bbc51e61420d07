"""Road networks from the columns of a graph: how a map that was saved uncut becomes a network again."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gamms.ir.graph import GraphColumns
from gamms.osm.network import RoadNetwork, connected, network_of_lines


def network_of_columns(columns: GraphColumns) -> RoadNetwork:
    """One road per edge: one-way where its attribute `oneway` is true, two-way otherwise."""
    tags = _tags_of_edges(columns)
    ends = (columns.sources, columns.targets)
    roads = network_of_lines(columns.xy, ends, columns.bends, columns.lengths, tags, columns.crs)
    two_way = np.fromiter((not of_edge.get("oneway", False) for of_edge in tags), np.bool_, len(tags))
    return connected(replace(roads, two_way=two_way))


def _tags_of_edges(columns: GraphColumns) -> list[Mapping[str, Any]]:
    tags: list[dict[str, Any]] = [{} for _ in range(len(columns.edge_ids))]
    for name, values in columns.edge_attributes.items():
        for row, value in values.items():
            tags[row][name] = value
    return [*tags]
