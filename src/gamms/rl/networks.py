"""Networks of policies, evaluated by NumPy or onnxruntime: observations in, a number for each action out.

A row gives the same numbers whatever other rows are evaluated with it, so that a policy acts equally in a batch and in
a single game: NumPy sums in 64 bits and rounds to 32 after each layer, onnxruntime gets blocks of a fixed size.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from itertools import chain
from threading import Timer
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.limits import max_memory
from gamms.plugins import require_extra
from gamms.rl.learners import Float32Array
from gamms.text import shown

DoubleArray = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Logits = Callable[[Mapping[str, Any]], Float32Array]
"""Maps observations `observation`, (rows, …), and `action_mask` to numbers for actions, (rows, actions)."""

_MOST_LAYERS = 64
_BLOCK = 64  # rows
_MOST_SECONDS = 10.0  # for one evaluation of an ONNX model
_EXTERNAL = re.compile(rb"(\x0a|\x8a\x80*\x00)(\x08|\x88\x80*\x00)location")
"""The key by which an ONNX file names an external file of weights, in every encoding of its numbers."""
_FUNCTIONS: dict[str, Callable[[DoubleArray], DoubleArray]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
    "silu": lambda x: x / (1.0 + np.exp(-x)),
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0))),
    "leaky_relu": lambda x: np.where(x > 0.0, x, 0.01 * x),
}
_OF_TORCH = {
    "Tanh": "tanh",
    "ReLU": "relu",
    "Sigmoid": "sigmoid",
    "SiLU": "silu",
    "ELU": "elu",
    "LeakyReLU": "leaky_relu",
}
_DEFAULTS = {"ELU": {"alpha": 1.0}, "LeakyReLU": {"negative_slope": 0.01}}  # other values are refused
_NOTHING = ("Identity", "Dropout", "Flatten")  # layers without effect when a policy is played

Layer = Literal["linear", "tanh", "relu", "sigmoid", "silu", "elu", "leaky_relu"]


class Architecture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The architecture of a feed-forward network, without its weights.

    Attributes:
        inputs: the inputs, concatenated.
        layers: the layers, in order; if layer n is linear, its weights are `n.weight` (out, in) and `n.bias` (out,).
        shared: None: the network returns numbers for all actions. Else it returns a single number and is evaluated for
            each action, with the first `shared` entries of an observation followed by the entries of the action.
    """

    inputs: Annotated[list[Literal["observation", "action_mask"]], msgspec.Meta(min_length=1, max_length=2)]
    layers: Annotated[list[Layer], msgspec.Meta(min_length=1, max_length=_MOST_LAYERS)]
    shared: Annotated[int, msgspec.Meta(ge=0, le=1 << 20)] | None = None


class Network(NamedTuple):
    """A feed-forward network.

    Attributes:
        architecture: its architecture.
        weights: float32 arrays, by the names in `Architecture`.
    """

    architecture: Architecture
    weights: dict[str, Float32Array]

    def check(self, entries: int, actions: int) -> None:
        """Check the weights against each other, and against the spaces of observations and actions.

        Raises:
            BadValue: they do not fit, or are not numbers.
        """
        shared = self.architecture.shared
        width = 0
        for part in self.architecture.inputs:
            width += entries if part == "observation" else actions
        if shared is not None:
            if self.architecture.inputs != ["observation"] or width < shared or (width - shared) % actions:
                raise BadValue(
                    f"With shared={shared}, the other entries of an observation are as many for each of the {actions} "
                    f"actions: {entries} entries do not fit."
                )
            width = shared + (width - shared) // actions
        expected = set()
        for number, layer in enumerate(self.architecture.layers):
            if layer != "linear":
                continue
            names = f"{number}.weight", f"{number}.bias"
            expected |= set(names)
            weight, bias = (self.weights.get(name, np.zeros(0, np.float32)) for name in names)
            if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1] or not len(bias):
                raise BadValue(
                    f"Layer {number} of the network gets {width} numbers, and has weights of the shape {weight.shape} "
                    f"and a bias of the shape {bias.shape}."
                )
            width = len(bias)
        wanted = actions if shared is None else 1
        if width != wanted:
            raise BadValue(f"The network gives {width} numbers, and {wanted} are needed, one for each action.")
        if expected != set(self.weights):
            raise BadValue(f"The weights of the network are {sorted(expected)}, not {sorted(self.weights)}.")
        if not all(np.isfinite(one).all() for one in self.weights.values()):
            raise BadValue("The network has weights that are not finite numbers.")

    def count_actions(self, entries: int, known_entries: int, known_actions: int) -> int | None:
        """Return for how many actions an observation has entries, for a network that is evaluated for each action.

        Args:
            entries: the number of entries of the observation.
            known_entries: the number of entries for `known_actions`.
            known_actions: a known number of actions.

        Returns:
            The number; 0 if the entries do not fit, None if no entry belongs to an action.
        """
        shared = self.architecture.shared or 0
        of_action = (known_entries - shared) // known_actions
        if not of_action:
            return None if entries == known_entries else 0
        number, rest = divmod(entries - shared, of_action)
        return 0 if rest else number

    def make_logits(self, actions: int) -> Logits:
        """Return the function that evaluates the network."""
        inputs = self.architecture.inputs
        shared = self.architecture.shared
        layers = [
            (
                self.weights[f"{number}.weight"].T.astype(np.float64),
                self.weights[f"{number}.bias"].astype(np.float64),
            )
            if kind == "linear"
            else _FUNCTIONS[kind]
            for number, kind in enumerate(self.architecture.layers)
        ]

        def evaluate(parts: Mapping[str, Any]) -> Float32Array:
            rows = len(parts["action_mask"])
            given = [np.asarray(parts[name]).reshape(rows, -1).astype(np.float32) for name in inputs]
            values: DoubleArray = np.concatenate(given, axis=1).astype(np.float64)
            if shared is not None:
                own = np.broadcast_to(values[:, None, :shared], (rows, actions, shared))
                values = np.concatenate((own, values[:, shared:].reshape(rows, actions, -1)), axis=2)
            with np.errstate(over="ignore", invalid="ignore"):
                for layer in layers:
                    values = values @ layer[0] + layer[1] if isinstance(layer, tuple) else layer(values)
                    values = values.astype(np.float32).astype(np.float64)
            return values.reshape(rows, actions).astype(np.float32)

        return evaluate


def read_network(model: Any, shared: int | None = None) -> Network:
    """Return the network of a model: an `nn.Sequential` of PyTorch, a model of Stable-Baselines3, or a list of layers.

    Raises:
        BadType: the model is none of these, or has layers that feed-forward networks do not have.
    """
    if type(model) is list:
        return _make_network(model, shared)
    if hasattr(model, "policy") and hasattr(model.policy, "mlp_extractor"):
        policy = model.policy
        extractors = getattr(policy.features_extractor, "extractors", {})
        inputs = list(extractors)
        modules = [*extractors.values(), policy.mlp_extractor.policy_net, policy.action_net]
    elif hasattr(model, "policy") and hasattr(getattr(model.policy, "actor", None), "latent_pi"):  # SAC
        actor = model.policy.actor
        extractors = getattr(actor.features_extractor, "extractors", {})
        inputs = list(extractors)
        modules = [*extractors.values(), actor.latent_pi, actor.mu]
    else:
        inputs = ["observation"]
        modules = [model]
    layers: list[str] = []
    weights: dict[str, Float32Array] = {}
    for module in modules:
        for layer in _list_layers(module):
            kind = type(layer).__name__
            if kind == "Linear":
                weight = _read_values(layer.weight)
                weights[f"{len(layers)}.weight"] = weight
                bias = np.zeros(len(weight), np.float32) if layer.bias is None else _read_values(layer.bias)
                weights[f"{len(layers)}.bias"] = bias
            layers += [] if kind in _NOTHING else [_OF_TORCH.get(kind, "linear")]
    if hasattr(getattr(getattr(model, "policy", None), "actor", None), "latent_pi"):
        layers.append("tanh")
    made = {"inputs": inputs or ["observation"], "layers": layers, "shared": shared}
    try:
        return Network(msgspec.convert(made, Architecture), weights)
    except msgspec.ValidationError as error:
        raise BadType(f"{shown(model)} cannot be saved as a feed-forward network: {error}. {_WAY}") from None


def _make_network(layers: Sequence[Any], shared: int | None) -> Network:
    """Return the network of a list of layers: pairs of arrays (weight, bias), and names of functions."""
    names: list[str] = []
    weights: dict[str, Float32Array] = {}
    for number, layer in enumerate(layers):
        if isinstance(layer, str):
            names.append(layer)
            continue
        try:
            weight, bias = (np.asarray(one, np.float32) for one in layer)
        except (TypeError, ValueError):
            raise BadType(
                f"Layer {number} of a policy is a pair of arrays, weight (out, in) and bias (out,), or the name of a "
                f"function, one of {', '.join(_FUNCTIONS)}; not {shown(layer)}."
            ) from None
        weights[f"{number}.weight"] = weight
        weights[f"{number}.bias"] = bias
        names.append("linear")
    try:
        architecture = msgspec.convert({"inputs": ["observation"], "layers": names, "shared": shared}, Architecture)
    except msgspec.ValidationError as error:
        raise BadType(f"A list of layers is not a feed-forward network: {error}.") from None
    return Network(architecture, weights)


_WAY = (
    "Export it with torch.onnx.export(…, external_data=False), and save the ONNX file: "
    "save_policy('network.onnx', 'policy.onnx', …)."
)


def _list_layers(module: Any) -> list[Any]:
    """Return the layers of a module, also from nested sequences."""
    kind = type(module).__name__
    if kind == "Sequential":
        return list(chain.from_iterable(_list_layers(part) for part in module))
    is_usual = all(getattr(module, key) == value for key, value in _DEFAULTS.get(kind, {}).items())
    if not is_usual or kind not in ("Linear", *_OF_TORCH, *_NOTHING):
        known = ", ".join(("Linear", *_OF_TORCH, *_NOTHING))
        raise BadType(
            f"A policy is saved as nn.Sequential of {known}, with their defaults; not {shown(module)}. {_WAY}"
        )
    return [module]


def _read_values(parameter: Any) -> Float32Array:
    values: Float32Array = parameter.detach().cpu().numpy().astype(np.float32)
    return values


def load_onnx_logits(model: bytes, what: str) -> tuple[Logits, dict[str, str]]:
    """Return the function that evaluates an ONNX model with onnxruntime on the CPU, and the model's metadata.

    The model takes `observation`, (rows, …) float32, and optionally `action_mask`, (rows, actions) float32; its first
    output has a number for each action, (rows, actions). Because a file may hold any computation, nothing is computed
    while loading it, an evaluation may take 10 seconds, and all models together may take `limits.max_memory`.
    onnxruntime checks the time between the nodes of the graph: a single node runs to its end.

    Raises:
        MissingExtra (ImportError): onnxruntime is not installed.
        BadFile: it is not a valid model, or has weights in other files.
    """
    with require_extra("A policy in ONNX", "onnx"):
        import onnxruntime
    if _EXTERNAL.search(model):
        raise BadFile(
            f"{what} may read its weights from other files, which is refused: save it as one "
            "file, torch.onnx.export(…, external_data=False)."
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL  # it would fold constants
    options.add_session_config_entry("session.use_env_allocators", "1")
    try:
        _bound_memory(max_memory())
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        names = [one.name for one in session.get_inputs()]
        metadata = dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # noqa: BLE001 - onnxruntime has classes of its own for each kind
        raise BadFile(f"{what} is not an ONNX model that onnxruntime can run: {error}") from None
    if "observation" not in names or not {*names} <= {"observation", "action_mask"}:
        raise BadFile(f"{what} takes {names}: a policy takes 'observation', and may take 'action_mask'.")

    def evaluate(parts: Mapping[str, Any]) -> Float32Array:
        run = onnxruntime.RunOptions()
        timer = Timer(_MOST_SECONDS, setattr, (run, "terminate", True))
        timer.daemon = True
        timer.start()
        try:
            return np.concatenate([*blocks(parts, run)])
        finally:
            timer.cancel()

    def blocks(parts: Mapping[str, Any], run: Any) -> Iterator[Float32Array]:
        for first in range(0, len(parts["action_mask"]), _BLOCK):
            given = {name: np.asarray(parts[name][first : first + _BLOCK], np.float32) for name in names}
            rows = len(given["observation"])
            full = {
                name: np.concatenate((one, np.zeros((_BLOCK - rows, *one.shape[1:]), np.float32)))
                for name, one in given.items()
            }
            try:
                yield np.asarray(session.run(None, full, run)[0], np.float32)[:rows]
            except Exception as error:  # noqa: BLE001 - see above
                if run.terminate:
                    raise BadFile(f"{what} takes longer than {_MOST_SECONDS:g} seconds: it is not a policy.") from None
                raise BadFile(f"{what} does not take observations as its game has them: {error}") from None

    return evaluate, metadata


@cache
def _bound_memory(most: int) -> None:
    """Limit the memory of all evaluated models together, in bytes; only the first call has an effect."""
    import onnxruntime

    kind = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR
    memory = onnxruntime.OrtMemoryInfo("Cpu", kind, 0, onnxruntime.OrtMemType.DEFAULT)
    with suppress(Exception):  # it was set before
        onnxruntime.create_and_register_allocator(memory, onnxruntime.OrtArenaCfg({"max_mem": most}))


def add_metadata(model: bytes, key: str, value: str) -> bytes:
    """Return an ONNX model with another entry in its metadata.

    Appending to a protocol buffers message adds fields to it: field 14 of a model holds its metadata entries, each with
    a key in field 1 and a value in field 2.
    """
    entry = b"".join(
        tag + _encode_length(text) + text for tag, text in ((b"\x0a", key.encode()), (b"\x12", value.encode()))
    )
    return model + b"\x72" + _encode_length(entry) + entry


def _encode_length(data: bytes) -> bytes:
    """Return the length of data as a varint: seven bits a byte, the lowest first."""
    number = len(data)
    found = bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes(found) + bytes([number])
