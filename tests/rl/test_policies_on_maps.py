"""A policy plays on all maps on which agents have at most as many legal nodes as in its training."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("safetensors", reason="safetensors is not installed")

from policy_scenes import Linear, Sequential
from safetensors import safe_open

from gamms import array_strategy, experiment, rl, tournament
from gamms.errors import BadValue
from gamms.recorder import open as open_recording
from gamms.scenario import Scenario, ScenarioError
from gamms.solve import exact_evader, exact_pursuers
from gamms.strategies import chase, stay

EXAMPLES = Path(__file__).parents[2] / "examples" / "rl"
WALK = "gamms.strategies:random_walk"
FIVE = {"grid": {"rows": 4, "columns": 4}}  # the most legal nodes: 5
NINE = {"generator": "king_moves:squares"}
FOUR = {"grid": {"rows": 2, "columns": 6}}
KING = """
import networkx as nx

def squares():
    graph = nx.DiGraph()
    nodes = {(x, y): 4 * y + x for x in range(4) for y in range(4)}
    for (x, y), number in nodes.items():
        graph.add_node(number, x=10.0 * x, y=10.0 * y)
    for (x, y), number in nodes.items():
        for other in ((x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j):
            if other in nodes:
                graph.add_edge(number, nodes[other], length=10.0)
    return graph
"""

TRAINED = """
from pathlib import Path
from gamms import rl

def trained(ctx):
    return rl.policy(Path(__file__).parent / "red.safetensors")(ctx)
"""
WAIT = """
def wait(state):
    state["action"] = state["curr_pos"]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "king_moves.py").write_text(KING)
    return tmp_path


def scene(map=FIVE, **changes):
    """Two taggers and a runner, who see to a distance."""
    team = {"count": 2, "strategy": WALK, "sensors": ["eyes"]}
    given = {
        "name": "hunt",
        "folder": Path.cwd(),
        "sensors": {"eyes": {"type": "AGENT_RANGE", "range_m": 25}},
        "teams": {"red": team, "blue": {**team, "count": 1}},
        "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
        "max_turns": 8,
    }
    return Scenario(map=map, **{**given, **changes})


def save(file, game, entries, actions, maps=None, **options):
    """Save a policy of the red team, of random weights."""
    model = Sequential(Linear(np.random.default_rng(1).normal(size=(actions, entries))))
    rl.save_policy(model, file, game, team="red", maps=maps, **options)
    return file


@pytest.fixture
def saved(folder):
    """A policy of two maps, of at most 5 and 9 legal nodes."""
    return save(folder / "red.safetensors", scene(), 2 + 9 * 3 + 2 * 5 + 1, 9, [FIVE, NINE])


def test_the_file_lists_the_maps_of_the_training(saved):
    described = json.loads(safe_open(saved, framework="numpy").metadata()["gamms"])
    assert described["maps"] == [scene(map).digests()["map"] for map in (FIVE, NINE)]
    assert described["spaces"]["actions"] == 9


@pytest.mark.parametrize("sample", [False, True])
@pytest.mark.parametrize("map", [FIVE, NINE, FOUR])
def test_a_policy_plays_on_each_map_alone_as_in_a_batch(saved, map, sample):
    red = rl.policy(saved, sample=sample)
    with scene(map).batch(5, strategies={"red": red}) as games:
        games.run()
        alone = [scene(map).play(seed=seed, strategies={"red": red}) for seed in range(5)]
        assert [games.result(game) for game in range(5)] == alone
    assert any(one.agents["red_0"]["moves"] for one in alone)


def test_a_policy_plays_in_a_batch_of_several_maps(saved):
    red = rl.policy(saved)
    maps = [FIVE, FOUR, NINE]
    with scene().batch(12, maps=maps, strategies={"red": red}) as games:
        games.run()
        assert {*games.maps.tolist()} == {0, 1, 2}
        for game, map in enumerate(games.maps.tolist()):
            assert games.result(game) == scene(maps[map]).play(seed=game, strategies={"red": red})


def test_a_policy_acts_on_a_narrow_map_as_in_the_environment_of_its_training(saved):
    evaluate = json.loads(safe_open(saved, framework="numpy").metadata()["gamms"])["spaces"]["actions"]
    weights = safe_open(saved, framework="numpy").get_tensor("0.weight")
    env = rl.vector_env(scene(), num_games=3, team="red", maps=[FIVE, NINE])
    observed, _ = env.reset(seed=0)
    on_five = np.repeat(env.learners.games.maps == 0, 2)
    logits = np.where(observed["action_mask"] > 0, observed["observation"] @ weights.T, -np.inf)
    assert on_five.any()
    assert evaluate == logits.shape[1]
    actions = logits.argmax(axis=1)
    env.step(actions)
    ends = env.learners.games.observe("red", map=0)
    env.close()
    with scene().batch(seeds=env.learners.games.seeds, strategies={"red": rl.policy(saved)}) as games:
        games.step()
        assert games.observe("red").node[ends.games].tolist() == ends.node.tolist()


def test_an_experiment_and_a_tournament_play_a_policy_on_a_third_map(saved, folder):
    red = rl.policy(saved)
    rows = experiment.run(scene(FOUR), range(3), {"strategies.red": {"trained": red}})
    assert [row["turns"] for row in rows] == [scene(FOUR).play(seed, {"red": red}).turns for seed in range(3)]
    assert not any(row["error"] for row in rows)
    for name, code in {"ours": TRAINED, "theirs": WAIT}.items():
        (folder / name).mkdir()
        (folder / name / "entry.py").write_text(code)
    shutil.copy(saved, folder / "ours")
    entries = {"trained": "ours/entry.py:trained", "wait": "theirs/entry.py:wait"}
    for map in (FOUR, FIVE):
        out = f"out_{map['grid']['rows']}"
        table = tournament.run(scene(map), entries=entries, seeds=[4], out=out, move_seconds=20.0)
        assert [row["faults"] for row in table.rows] == [{}, {}]
        row = next(row for row in table.rows if row["entries"]["red"] == "trained")
        with open_recording(folder / out / "games" / f"{row['id']}.ggr") as recording:
            last = recording[-1].agents
            seed = recording.seed
        alone = scene(map).play(seed=seed, strategies={"red": red, "blue": stay})
        places = dict(zip(last["name"], last["node"], strict=True))
        assert places == {name: one["node"] for name, one in alone.agents.items()}


def test_a_map_with_more_legal_nodes_is_refused(folder):
    file = save(folder / "narrow.safetensors", scene(), 2 + 5 * 3 + 2 * 5 + 1, 5)
    assert scene(FOUR).play(seed=1, strategies={"red": rl.policy(file)}).turns == 8
    with pytest.raises(BadValue, match="maps with at most 5 legal nodes of an agent, and here are 9: train it with"):
        scene(NINE).play(seed=1, strategies={"red": rl.policy(file)})


def in_directions(view):
    """Observe where each agent is, and where each of its actions leads."""
    vector = view.vector(0).values
    return np.concatenate((view["xy"], vector[..., 2:]), axis=2, dtype=np.float32)


def of_streets(view):
    """Observe the nodes that actions lead to, as many as on the map."""
    return np.concatenate((view["xy"], view.streets.legal[view.node]), axis=2, dtype=np.float32)


@pytest.mark.parametrize(("observe", "of_action"), [(in_directions, 3), (of_streets, 1)])
def test_a_network_for_each_action_plays_on_any_map(folder, observe, of_action):
    file = folder / "each.safetensors"
    options = {"observation": observe, "shared": 2}
    save(file, scene(FOUR), 2 + of_action, 1, **options)
    red = rl.policy(file, observation=observe)
    for map in (FOUR, FIVE, NINE, {"grid": {"rows": 1, "columns": 9}}):
        with scene(map).batch(3, strategies={"red": red}) as games:
            games.run()
            alone = [scene(map).play(seed=seed, strategies={"red": red}) for seed in range(3)]
            assert [games.result(game) for game in range(3)] == alone


def test_a_network_for_each_action_refuses_fewer_entries_than_actions(folder):
    def shortened(view):
        return of_streets(view)[..., :5]

    file = save(folder / "each.safetensors", scene(FOUR), 3, 1, observation=of_streets, shared=2)
    with pytest.raises(BadValue, match=r"observations of the shape \(6,\).*of the shape \(5,\)"):
        scene(FOUR).play(strategies={"red": rl.policy(file, observation=shortened)})


def test_a_policy_changes_no_vectors_of_other_strategies(saved):
    @array_strategy
    def measure(view):
        return np.full(view.node.shape, view.vector(1).values.shape[2] - (2 + 5 * 3 + 5))

    with scene().batch(2, strategies={"red": rl.policy(saved), "blue": measure}) as games:
        before = games.observe("blue").node.copy()
        games.step()
        assert (games.observe("blue").node == before).all()


def test_other_rules_sensors_and_speeds_need_permission(saved):
    both = [rl.policy(saved, other_scenario=allowed) for allowed in (False, True)]
    sensors = {"eyes": {"type": "AGENT_RANGE", "range_m": 99}}
    teams = scene().to_dict()["teams"]
    fast = {**teams, "red": {**teams["red"], "speed": 1.0}}
    changes = {
        "other rules than this game": {"rules": ["last_team"]},
        "other sensors, or with another speed, than 'red_0' has": {"sensors": sensors},
        "with another speed, than 'red_0'": {"teams": fast},
    }
    for message, change in changes.items():
        with pytest.raises(ValueError, match=rf"{message}.*rl.policy\(path, other_scenario=True\) lets it play"):
            scene(**change).play(strategies={"red": both[0]})
        assert scene(**change).play(strategies={"red": both[1]}).turns == 8


def test_other_teams_turns_and_sensors_of_others_need_no_permission(saved):
    given = scene().to_dict()
    sensors = {**given["sensors"], "far": {"type": "AGENT", "fov": 3.0}}
    teams = {**given["teams"], "blue": {**given["teams"]["blue"], "sensors": ["far"]}}
    other = scene(name="other", sensors=sensors, teams=teams, max_turns=5)
    assert other.play(strategies={"red": rl.policy(saved)}).turns == 5


def test_a_file_of_an_earlier_version_plays_where_its_rules_and_sensors_are(saved, folder):
    from safetensors.numpy import save_file

    with safe_open(saved, framework="numpy") as opened:
        weights = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
        described = json.loads(opened.metadata()["gamms"])
    for key in ("maps", "equipment"):
        del described[key]
    save_file(weights, folder / "old.safetensors", {"gamms": json.dumps(described)})
    old = rl.policy(folder / "old.safetensors")
    assert scene(FOUR).play(2, {"red": old}).agents == scene(FOUR).play(2, {"red": rl.policy(saved)}).agents
    with pytest.raises(ScenarioError, match="which has other sensors than this game"):
        scene(sensors={"eyes": {"type": "AGENT_RANGE", "range_m": 99}}).play(strategies={"red": old})


def test_a_flying_agent_takes_its_policy_to_other_maps(folder):
    team = {"count": 1, "type": "aerial", "speed": 8.0, "altitude": 20.0}
    teams = {"red": team, "blue": {"count": 1, "strategy": WALK}}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "air": True, "euclid": 9}}
    entries = 2 + 9 * 3 + 5 + 2
    file = save(folder / "air.safetensors", scene(teams=teams, rules=[tag]), entries, 3, [FIVE, NINE])
    for map in (FIVE, NINE, FOUR):
        played = scene(map, teams=teams, rules=[tag]).play(seed=1, strategies={"red": rl.policy(file)})
        assert played.turns == 8


def test_the_trained_pursuers_catch_more_exact_evaders_than_chase_does():
    eyes = {"eyes": {"type": "AGENT"}}
    teams = {"red": {"count": 2, "sensors": ["eyes"]}, "blue": {"count": 1, "sensors": ["eyes"]}}
    catch = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    turns = {"settings": {"order": [["red"], ["blue"]]}, "max_turns": 40, "rules": [catch, "last_team"]}
    district = {"generator": {"function": "crop:district", "with": {"number": 13}}}
    pursuit = Scenario(map=district, folder=EXAMPLES, sensors=eyes, teams=teams, **turns)
    players = {"chase": chase, "trained": rl.trained_pursuers}
    found = rl.evaluate(pursuit, players, team="red", opponents={"exact": exact_evader}, games=40, exact=exact_pursuers)
    assert found.gap_closed("trained") > 0.3
    row = next(row for row in found.rows if row["strategies.red"] == "trained" and row["seed"] == 3)
    alone = pursuit.replace(teams={**teams, "red": {**teams["red"], "strategy": "gamms.rl:trained_pursuers"}})
    assert alone.play(seed=3, strategies={"blue": exact_evader}).turns == row["turns"]
