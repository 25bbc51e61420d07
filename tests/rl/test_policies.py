"""Policies that are saved, and play as strategies."""

import json
import struct
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("safetensors", reason="safetensors is not installed")

from safetensors import safe_open
from safetensors.numpy import save_file

import gamms
from gamms import rl
from gamms.errors import BadFile, BadType, BadValue, MissingFile, MissingFolder, TooLarge
from gamms.rl.networks import Architecture, Network, add_metadata
from gamms.scenario import Scenario, ScenarioError, from_recording, load

WALK = "gamms.strategies:random_walk"
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


def scene(red=2, width=4, sensors=True, **more):
    """Taggers and runners on a grid."""
    teams = {"red": {"count": red, "strategy": WALK}, "blue": {"count": 2, "strategy": WALK}}
    if sensors:
        teams["red"]["sensors"] = ["near"]
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 15}}
    given = {"name": "tag", "teams": teams, "sensors": near, "rules": [TAG], "max_turns": 15, **more}
    return Scenario(map={"grid": {"width": width, "height": 4}}, **given)


class Values:
    """Parameters as PyTorch has them."""

    def __init__(self, values):
        self.values = np.asarray(values, np.float32)

    def detach(self):
        return self

    cpu = detach

    def numpy(self):
        return self.values


class Linear:
    def __init__(self, entries, numbers, seed=1):
        random = np.random.default_rng(seed)
        self.weight = Values(random.normal(size=(numbers, entries)))
        self.bias = Values(random.normal(size=numbers))


class Tanh:
    pass


class Softsign:
    pass


class Sequential(list):
    def __init__(self, *layers):
        super().__init__(layers)


def network(entries=33, actions=5, width=16):
    return Sequential(Linear(entries, width), Sequential(Tanh(), Linear(width, actions, 2)))


ENTRIES = 2 + 3 * 5 + 5 * 3 + 1  # of the default observation: 5 actions, 3 others


@pytest.fixture
def saved(tmp_path):
    """A policy of the red team."""
    file = tmp_path / "red.safetensors"
    rl.save_policy(network(ENTRIES), file, scene(), team="red")
    return file


@pytest.mark.parametrize("sample", [False, True])
def test_a_policy_plays_the_same_games_alone_and_in_a_batch(saved, sample):
    red = rl.policy(saved, sample=sample)
    with scene().batch(8, strategies={"red": red}) as games:
        games.run()
        alone = [scene().play(seed=seed, strategies={"red": red}) for seed in range(8)]
        assert [games.result(game) for game in range(8)] == alone


def test_samples_follow_from_the_seed_and_differ_from_the_best_actions(saved):
    games = [
        scene().play(seed=2, strategies={"red": rl.policy(saved, sample=sample)}) for sample in (True, True, False)
    ]
    assert games[0] == games[1] != games[2]


def test_a_scenario_file_names_a_policy_beside_it(saved, tmp_path):
    code = {"function": "gamms.rl:policy", "with": {"path": "red.safetensors"}}
    given = scene().replace(**{"teams.red.strategy": code}).to_dict()
    (tmp_path / "match.json").write_text(json.dumps(given))
    match = load(tmp_path / "match.json")
    assert any("references to code" in line for line in match.check())
    result = match.play(seed=1, record=tmp_path / "game.ggr")
    assert result.agents == scene().play(seed=1, strategies={"red": rl.policy(saved)}).agents
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        again = from_recording(recording, folder=tmp_path)
    assert again.play(seed=1).agents == result.agents


def test_a_scenario_file_names_policies_of_its_folder_that_are_data(saved, tmp_path):
    def playing(**parameters):
        code = {"function": "gamms.rl:policy", "with": parameters}
        return scene(folder=tmp_path).replace(**{"teams.red.strategy": code})

    with pytest.raises(ScenarioError, match=r"there is no file 'blue.safetensors'"):
        playing(path="blue.safetensors").check()
    with pytest.raises(ScenarioError, match="leads out of the folder"):
        playing(path="../red.safetensors").check()
    (tmp_path / "red.pt").write_bytes(b"pickle")
    with pytest.raises(ScenarioError, match="takes no such parameter"):
        playing(path="red.pt", trusted=True).check()
    with pytest.raises(ScenarioError, match="is a pickle, and reading one runs the code"):
        playing(path="red.pt").play(seed=1)
    with pytest.raises(ScenarioError, match="there is no function 'save_policy'"):
        scene(folder=tmp_path).replace(**{"teams.red.strategy": "gamms.rl:save_policy"}).check()


def test_a_policy_is_bound_to_its_spaces_rules_and_sensors_alone(saved):
    other = scene(name="other", width=5, seed=7, max_turns=9)
    other = other.replace(**{"teams.blue.strategy": "gamms.strategies:stay"})
    assert other.play(strategies={"red": rl.policy(saved)}).turns == 9


def test_another_scenario_can_be_allowed_if_its_spaces_are_the_same(saved):
    red = rl.policy(saved, other_scenario=True)
    assert scene(width=6, rules=["last_team"]).play(seed=1, strategies={"red": red}).turns == 15
    with pytest.raises(BadValue, match=r"observations of the shape \(33,\).*here are 5, of the shape \(38,\)"):
        scene(red=3).play(seed=1, strategies={"red": red})
    with pytest.raises(ScenarioError, match=r"has other rules than this game: rl.policy\(path, other_scenario=True\)"):
        scene(rules=["last_team"]).play(seed=1, strategies={"red": rl.policy(saved)})


def test_a_file_of_a_version_without_distances_by_road_plays_on(tmp_path, saved):
    file = tmp_path / "old.safetensors"
    rl.save_policy(network(30), file, scene(), team="red", observation=rl.straight_observation)
    spaces = [
        json.loads(safe_open(one, framework="numpy").metadata()["gamms"])["spaces"]  # as these versions wrote them
        for one in (file, saved)
    ]
    assert [(one["function"], one["observation"]) for one in spaces] == [
        ("default", [30]),
        ("default with roads", [33]),
    ]
    red = rl.policy(file)
    with scene().batch(4, strategies={"red": red}) as games:
        games.run()
        assert [games.result(game) for game in range(4)] == [
            scene().play(seed=game, strategies={"red": rl.policy(file, observation=rl.straight_observation)})
            for game in range(4)
        ]


def together(view):
    """What an agent and all of its team observe: where they are, and how often each was near an enemy."""
    kept = view.keep("near", lambda games: {"near": np.zeros((games, len(view.roster.names)), np.float32)})["near"]
    seen = view.enemies()
    kept[view.games[seen.at], seen.others] += 1
    others = np.broadcast_to(view["xy"].sum(axis=1, keepdims=True), view["xy"].shape)
    return np.concatenate((view["xy"] - others, np.repeat(kept[view.games][:, None], view.node.shape[1], 1)), axis=2)


def test_observations_of_a_team_are_the_same_in_a_game_alone(tmp_path):
    file = tmp_path / "together.safetensors"
    with rl.Learners(scene(), 3, teams=["red"], observation=together) as learners:
        rl.save_policy(network(6), file, learners)
    with pytest.raises(BadValue, match=r"was trained with the observation .*test_policies:together: give that"):
        rl.policy(file)
    red = rl.policy(file, observation=together)
    with scene().batch(6, strategies={"red": red}) as games:
        games.run()
        for game in range(6):
            assert games.result(game) == scene().play(seed=game, strategies={"red": red})


def test_one_agent_can_be_trained_alone(tmp_path):
    file = tmp_path / "one.safetensors"
    env = rl.single_agent_env(scene(), agent="red_1", observation=lambda view: view["xy"])
    rl.save_policy(network(2), file, env)
    red = {"red_1": rl.policy(file, observation=lambda view: view["xy"])}
    with scene().batch(4, strategies=red) as games:
        games.run()
        assert [games.result(game) for game in range(4)] == [scene().play(seed=s, strategies=red) for s in range(4)]


def test_a_network_can_be_asked_for_each_action(tmp_path):
    file = tmp_path / "each.safetensors"

    def of_actions(view):
        legal = view.streets.legal[view.node]
        return np.concatenate((view["xy"], legal.astype(np.float32)), axis=2)

    highest = Linear(3, 1)
    highest.weight.values[:], highest.bias.values[:] = [[0, 0, 1]], 0
    rl.save_policy(Sequential(highest), file, scene(), team="red", observation=of_actions, shared=2)
    with scene().batch(3, strategies={"red": rl.policy(file, observation=of_actions)}) as games:
        before = games.observe("red")
        games.step()
        assert (games.observe("red").node == before.streets.legal[before.node].max(axis=2)).all()


def test_layers_may_be_arrays(tmp_path):
    random = np.random.default_rng(1)
    first, last = random.normal(size=(16, ENTRIES)), random.normal(size=(5, 16))
    layers = [(first, np.zeros(16)), "tanh", (last, np.ones(5))]
    rl.save_policy(layers, tmp_path / "red.safetensors", scene(), team="red")
    with safe_open(tmp_path / "red.safetensors", framework="numpy") as opened:
        assert (opened.get_tensor("2.weight") == last.astype(np.float32)).all()
    assert scene().play(seed=1, strategies={"red": rl.policy(tmp_path / "red.safetensors")}).turns > 0
    with pytest.raises(BadType, match=r"Layer 0 of a policy is a pair of arrays.*not 5"):
        rl.save_policy([5], tmp_path / "no.safetensors", scene(), team="red")
    with pytest.raises(BadType, match="not a feed-forward network: Invalid enum value 'softmax'"):
        rl.save_policy([*layers, "softmax"], tmp_path / "no.safetensors", scene(), team="red")


@pytest.mark.parametrize("entries", [1, 2 + 5 * 3 + 1])
def test_a_network_that_is_asked_for_each_action_gets_as_many_entries_of_each(entries):
    with pytest.raises(BadValue, match=f"as many for each of the 5 actions: {entries} entries do not fit"):
        Network(Architecture(["observation"], ["linear"], shared=2), {}).check(entries, 5)


def test_values_that_cannot_be_saved_are_refused_by_name(tmp_path):
    with pytest.raises(BadValue, match=r"saved as .safetensors or .onnx, not as 'red.pkl'"):
        rl.save_policy(network(), tmp_path / "red.pkl", scene(), team="red")
    with pytest.raises(MissingFolder, match="There is no folder"):
        rl.save_policy(network(), tmp_path / "none" / "red.safetensors", scene(), team="red")
    file = tmp_path / "red.safetensors"
    with pytest.raises(BadType, match=r"saved as nn.Sequential of Linear.*torch.onnx.export"):
        rl.save_policy(Sequential(Softsign()), file, scene(), team="red")
    with pytest.raises(
        BadValue, match=r"Layer 0 of the network gets 33 numbers, and has weights of the shape \(16, 7\)"
    ):
        rl.save_policy(network(7), file, scene(), team="red")
    with pytest.raises(BadValue, match="The network gives 4 numbers, and 5 are needed"):
        rl.save_policy(network(ENTRIES, 4), file, scene(), team="red")
    with pytest.raises(BadType, match=r"env must be an environment of gamms.rl, or a scenario, not 'match.yaml'"):
        rl.save_policy(network(), file, "match.yaml")
    with pytest.raises(BadValue, match="not finite numbers"):
        broken = network(ENTRIES)
        broken[0].bias.values[3] = np.nan
        rl.save_policy(broken, file, scene(), team="red")


def changed(file, change, tmp_path):
    """The policy with other metadata or weights."""
    with safe_open(file, framework="numpy") as opened:
        weights = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
        described = json.loads(opened.metadata()["gamms"])
    described, weights = change(described, weights) or (described, weights)
    other = tmp_path / "changed.safetensors"
    save_file(weights, other, {"gamms": described if isinstance(described, str) else json.dumps(described)})
    return other


HOSTILE = {
    "no object": (lambda d, w: ("[" * 5000, w), "metadata that GAMMS does not know"),
    "too long": (lambda d, w: ({**d, "scenario": "x" * 300_000}, w), "bytes of metadata, more than"),
    "unknown key": (lambda d, w: ({**d, "run": "os.system"}, w), "unknown field `run`"),
    "unknown layer": (lambda d, w: d["network"]["layers"].append("eval"), "Invalid enum value 'eval'"),
    "too many layers": (lambda d, w: d["network"]["layers"].extend(["tanh"] * 99), "metadata that GAMMS does not know"),
    "other spaces": (lambda d, w: d["spaces"].update(actions=4), "do not have the hash"),
    "too many weights": (lambda d, w: w.update(more=np.zeros(3, np.float32)), "is damaged: The weights"),
    "other shapes": (lambda d, w: w.update({"0.weight": np.zeros((16, 2), np.float32)}), "is damaged: Layer 0"),
    "no bias": (lambda d, w: w.pop("0.bias") is None, "is damaged: Layer 0"),
    "no numbers": (lambda d, w: w["0.bias"].fill(np.inf), "not finite numbers"),
    "other type": (lambda d, w: w.update({"0.bias": np.zeros(16, np.int64)}), "of the type F32, not I64"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_file_that_was_changed_is_refused(saved, tmp_path, name):
    change, message = HOSTILE[name]

    def apply(described, weights):
        found = change(described, weights)
        return found if isinstance(found, tuple) else None

    with pytest.raises(BadFile, match=message):
        rl.policy(changed(saved, apply, tmp_path))


def test_a_file_that_is_no_policy_is_refused(saved, tmp_path):
    with pytest.raises(MissingFile, match=r"There is no file .*none.safetensors' for a policy"):
        rl.policy(tmp_path / "none.safetensors")
    with pytest.raises(BadFile, match=r"is not a policy: policies are .safetensors, .onnx"):
        rl.policy(tmp_path / "red.txt")
    other = tmp_path / "other.safetensors"
    save_file({"x": np.zeros(1, np.float32)}, other)
    with pytest.raises(BadFile, match="has no metadata of GAMMS"):
        rl.policy(other)
    for data in (b"", b"\xff" * 100, struct.pack("<Q", 1 << 40) + b"{}", saved.read_bytes()[:-10]):
        other.write_bytes(data)
        with pytest.raises(BadFile, match="is not a safetensors file, or is damaged"):
            rl.policy(other)
    with gamms.limits.allowing(10_000), pytest.raises(TooLarge, match=r"The policy .* bytes would take"):
        rl.policy(saved)


def test_a_pickle_is_read_only_if_it_is_trusted(tmp_path):
    (tmp_path / "red.zip").write_bytes(b"pickle")
    with pytest.raises(BadValue, match=r"is a pickle, and reading one runs the code that is in it: .*trusted=True"):
        rl.policy(tmp_path / "red.zip")


@pytest.mark.parametrize(("value", "length"), [("v" * 5, b"\x05"), ("v" * 300, b"\xac\x02")])
def test_metadata_are_an_entry_of_field_14_with_key_and_value(value, length):
    entry = b"\x0a\x03key\x12" + length + value.encode()
    size = bytes([len(entry)]) if len(entry) < 128 else bytes([len(entry) & 127 | 128, len(entry) >> 7])
    assert add_metadata(b"model", "key", value) == b"model\x72" + size + entry


@pytest.mark.parametrize("kind", ["memory", "time"])
def test_an_onnx_model_without_an_end_is_stopped(kind, tmp_path, monkeypatch):
    pytest.importorskip("onnxruntime", reason='onnxruntime is not installed: pip install ".[onnx]"')
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    monkeypatch.setattr("gamms.rl.networks._MOST_SECONDS", 20.0 if kind == "memory" else 0.05)
    make, value = onnx.helper.make_node, onnx.helper.make_tensor_value_info
    names, weights = ["observation", *(f"n{number}" for number in range(1000))], []
    if kind == "memory":  # twice as wide with each node
        nodes = [make("Concat", [one, one], [after], axis=1) for one, after in pairwise(names[:41])]
        nodes.append(make("ReduceMean", [names[40]], ["numbers"]))
    else:
        large = np.ones((1500, 1500), np.float32)
        weights = [onnx.numpy_helper.from_array(large[:ENTRIES], "w"), onnx.numpy_helper.from_array(large, "v")]
        nodes = [make("MatMul", ["observation", "w"], ["n0"])]
        nodes += [make("MatMul", [one, "v"], [after]) for one, after in pairwise(names[1:])]
        nodes.append(make("ReduceMean", [names[-1]], ["numbers"]))
    given = [value("observation", onnx.TensorProto.FLOAT, ["n", ENTRIES])]
    graph = onnx.helper.make_graph(nodes, "policy", given, [value("numbers", onnx.TensorProto.FLOAT, None)], weights)
    opset = [onnx.helper.make_opsetid("", 17)]
    onnx.save(onnx.helper.make_model(graph, ir_version=9, opset_imports=opset), tmp_path / "net.onnx")
    with pytest.raises(BadFile, match="takes longer than 0.05 seconds" if kind == "time" else "does not take"):
        rl.save_policy(tmp_path / "net.onnx", tmp_path / "red.onnx", scene(), team="red")
