"""Tracks with errors, matched to the streets of Helsinki: the length on wrong edges, beside leuvenmapmatching.

    python benchmarks/tracks.py                                   # 30 tracks of each case
    python benchmarks/tracks.py --peer one/bin/python             # the same tracks by leuvenmapmatching, too
    python -m venv one && one/bin/pip install leuvenmapmatching rtree      # makes this environment

Tracks are shortest routes over at least 40 edges between nodes drawn by a fixed seed, walked at 1.4 m/s. Errors that
last are a first-order Gauss-Markov process. An edge is wrong if it is on the true route in neither direction.
"""

import argparse
import json
import pickle
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

SPEED = 1.4  # m/s
CASES = {  # meters between points, standard deviation in meters, seconds that errors last
    "4 m, independent, every 20 m": (20.0, 4.0, 0.0),
    "4 m for 30 s, every 20 m": (20.0, 4.0, 30.0),
    "8 m for 30 s, every 20 m": (20.0, 8.0, 30.0),
    "8 m for 10 s, every 20 m": (20.0, 8.0, 10.0),
    "8 m, independent, every 10 m": (10.0, 8.0, 0.0),
}


def make_tracks(graph, count, every, noise_m, lasting_s):
    """Return (nodes of the true route, points) of tracks."""
    rng = np.random.default_rng(7)
    ids = graph.columns().node_ids
    tracks = []
    while len(tracks) < count:
        try:
            path = graph.shortest_path(*map(int, rng.choice(ids, 2)))
        except ValueError:
            continue
        if len(path) > 40:
            xy = np.array([(node.x, node.y) for node in map(graph.get_node, path)])
            gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
            at = np.arange(0.0, gone[-1], every)
            errors = rng.normal(0.0, noise_m, (len(at), 2))
            kept = np.exp(-every / SPEED / lasting_s) if lasting_s else 0.0
            for before, after in pairwise(errors):
                after[:] = kept * before + np.sqrt(1.0 - kept**2) * after
            tracks.append((path, np.column_stack([np.interp(at, gone, axis) for axis in xy.T]) + errors))
    return tracks


def figures_of(edges, true, lengths, covered):
    """Return the lengths of the wrong edges over the true length, and of all over the length with points."""
    right = {frozenset(pair) for pair in pairwise(true)}
    wrong = sum(lengths[pair] for pair in edges if frozenset(pair) not in right)
    return wrong / sum(lengths[pair] for pair in pairwise(true)), sum(lengths[pair] for pair in edges) / covered


def show(matcher, case, figures, seconds):
    """Print the means over tracks as a line of JSON."""
    wrong, total = np.mean(figures, axis=0)
    record = {"case": case, "matcher": matcher, "wrong": wrong, "total": total, "cpu_s": seconds / len(figures)}
    print(
        json.dumps({key: round(one, 3) if isinstance(one, float) else one for key, one in record.items()}), flush=True
    )


def match_by_peer(file):
    """Match the tracks in a file by leuvenmapmatching; runs in its environment."""
    from leuvenmapmatching.map.inmem import InMemMap
    from leuvenmapmatching.matcher.distance import DistanceMatcher

    places, lines, lengths, cases = pickle.loads(Path(file).read_bytes())
    roads = InMemMap("helsinki", use_latlon=False, use_rtree=True, index_edges=True)
    owner = {}  # pieces of an edge that bends -> the edge
    for node, (x, y) in places.items():
        roads.add_node(node, (y, x))
    for pair, line in lines.items():
        for piece in pairwise(line):
            roads.add_edge(*piece)
            owner[piece] = pair
    for case, (every, noise_m, tracks) in cases.items():
        began = time.process_time()
        figures = []
        for true, points in tracks:
            matcher = DistanceMatcher(
                roads, max_dist=50, obs_noise=noise_m, obs_noise_ne=2 * noise_m, dist_noise=noise_m,
                min_prob_norm=1e-4, max_lattice_width=10, non_emitting_states=True,
            )  # fmt: skip
            matcher.match([(y, x) for x, y in points], unique=True)
            found = [owner[piece] for piece in pairwise(matcher.path_pred_onlynodes) if piece in owner]
            edges = [one for at, one in enumerate(found) if not at or one != found[at - 1]]
            figures.append(figures_of(edges, true, lengths, every * (len(points) - 1)))
        show("leuvenmapmatching", case, figures, time.process_time() - began)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tracks", type=int, default=30, help="of each case")
    parser.add_argument("--peer", help="Python of an environment with leuvenmapmatching")
    parser.add_argument("--match", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.match:
        match_by_peer(chosen.match)
        return
    import gamms
    from gamms.ir.graph import find_shortest_edges

    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        gamms.osm.helsinki(ctx, buildings=False)
        graph = ctx.graph
        columns = graph.columns()
        lengths = find_shortest_edges(columns)
        graph.match_track(columns.xy[:1])  # so that the index of edges is ready
        cases = {}
        for case, (every, noise_m, lasting_s) in CASES.items():
            tracks = make_tracks(graph, chosen.tracks, every, noise_m, lasting_s)
            cases[case] = every, noise_m, tracks
            began = time.process_time()
            found = [graph.match_track(points, noise_m=noise_m).paths for _, points in tracks]
            spent = time.process_time() - began
            edges = [[pair for path in paths for pair in pairwise(path)] for paths in found]
            covered = [every * (len(points) - 1) for _, points in tracks]
            trues = [true for true, _ in tracks]
            figures = [figures_of(*one, lengths, far) for *one, far in zip(edges, trues, covered, strict=True)]
            show("gamms", case, figures, spent)
        if chosen.peer:
            places, lines = as_pieces(columns)
            with tempfile.NamedTemporaryFile() as file:
                Path(file.name).write_bytes(pickle.dumps((places, lines, lengths, cases)))
                subprocess.run([chosen.peer, __file__, "--match", file.name], check=True)


def as_pieces(columns):
    """Return the places of nodes and of bends, and the nodes of the line of each edge by its ends."""
    places = dict(zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True))
    lines = {}
    for row, ends in enumerate(zip(columns.sources.tolist(), columns.targets.tolist(), strict=True)):
        source, target = columns.node_ids[[*ends]].tolist()
        bends = columns.polylines[row][1:-1].tolist() if row in columns.polylines else []
        numbers = range(-len(places) - 1, -len(places) - 1 - len(bends), -1)
        places |= dict(zip(numbers, bends, strict=True))
        lines[source, target] = [source, *numbers, target]
    return places, lines


if __name__ == "__main__":
    sys.exit(main())
