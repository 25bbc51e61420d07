"""Files of experiments, YAML or JSON: a scenario, seeds and variations. They are data: reading runs no code."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from gamms.arguments import as_path
from gamms.errors import BadType, BadValue, nearest
from gamms.experiment.sampling import sample
from gamms.experiment.variants import Vary
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.scenario import Scenario, ScenarioError, load
from gamms.scenario.code import find_path
from gamms.scenario.documents import locate_errors, name_errors, read
from gamms.text import describe_empty_range, describe_lone_seed, shown

_KEYS = ("scenario", "seeds", "vary", "sample", "out", "workers")
_OF_SAMPLE = ("space", "n", "method", "seed")
_BYTES = 60  # of a seed; 40 measured


class ExperimentFile(NamedTuple):
    """The content of an experiment file: the arguments of `run`; `out` and `workers` may be None."""

    scenario: Scenario
    seeds: list[int]
    vary: Vary | None
    out: Path | None
    workers: int | None


def read_experiment(
    path: str | os.PathLike[str], allow: Iterable[str] = (), key_variable: str | None = None
) -> ExperimentFile:
    """Read the file of an experiment; paths of the scenario and the results start from its folder.

    Args:
        path: the file.
        allow: see `scenario.load`.
        key_variable: see `scenario.load`.

    Raises:
        ScenarioError: the file is not valid; the message names the place and the nearest valid key.
        OSError: the file cannot be read.
    """
    file = as_path(path, "path")
    folder = file.absolute().parent
    with name_errors(file):
        raw = read(file)
        if not isinstance(raw, Mapping):
            raise ScenarioError("", f"an experiment is a mapping with scenario and seeds; this is {shown(raw)}.")
        _check_keys(raw, _KEYS, "")
        for key in ("scenario", "seeds"):
            if key not in raw:
                raise ScenarioError(key, "is missing.")
        if "vary" in raw and "sample" in raw:
            raise ScenarioError("sample", "an experiment has vary or sample, not both.")
        game, out = (None if raw.get(key) is None else _find_file(raw[key], folder, key) for key in ("scenario", "out"))
        if game is None:
            raise ScenarioError("scenario", "is the name of a scenario file beside this one.")
        with locate_errors("sample" if "sample" in raw else "seeds"):
            vary = _make_sample(raw["sample"]) if "sample" in raw else raw.get("vary")
            seeds = parse_seeds(raw["seeds"])
        workers = raw.get("workers")
        if workers is not None and (type(workers) is not int or workers < 1):
            raise ScenarioError("workers", f"is how many processes play, at least 1, not {shown(workers)}.")
        return ExperimentFile(load(game, allow, key_variable=key_variable), seeds, vary, out, workers)


def parse_seeds(given: Plain) -> list[int]:
    """Return seeds from a list, or from a text: "0:50", which is 0 to 49, or "1,2,5".

    Raises:
        BadValue, BadType: the value is neither.
    """
    if isinstance(given, list):
        return given
    if type(given) is int:
        raise BadValue(describe_lone_seed(given))
    if not isinstance(given, str):
        raise BadType(f"seeds are a list of integers, or a text such as 0:50, not {shown(given)}.")
    first, colon, last = given.partition(":")
    try:
        numbers = [int(one) for one in ((first or "0", last) if colon else given.split(","))]
    except ValueError:
        raise BadValue(f"seeds are 0:50 or 1,2,5, not {shown(given)}.") from None
    if not colon and len(numbers) == 1:
        raise BadValue(describe_lone_seed(numbers[0]))
    if not colon:
        return numbers
    if numbers[0] > numbers[1]:
        raise BadValue(f"seeds: {describe_empty_range(given, *numbers)}")
    if numbers[0] == numbers[1]:
        raise BadValue(f"seeds are 0:50 or 1,2,5, and {shown(given)} names none.")
    refuse_above((numbers[1] - numbers[0]) * _BYTES, f"A list of {numbers[1] - numbers[0]:,} seeds")
    return list(range(*numbers))


def _find_file(given: Plain, folder: Path, key: str) -> Path:
    if not isinstance(given, str) or not given:
        raise ScenarioError(key, f"is the name of a file or folder beside this one, not {shown(given)}.")
    return find_path(given, folder, key, "file" if key == "scenario" else "folder")


def _make_sample(given: Plain) -> Vary:
    if not isinstance(given, Mapping) or not {"space", "n"} <= set(given):
        raise BadValue(f"a sample has space and n, not {shown(given)}.")
    _check_keys(given, _OF_SAMPLE, "sample.")
    return sample(given["space"], given["n"], given.get("method", "sobol"), seed=given.get("seed", 0))


def _check_keys(given: Mapping[Plain, Plain], known: tuple[str, ...], where: str) -> None:
    for key in given:
        if key not in known:
            hint = nearest(key, known) or f" Keys here are: {', '.join(known)}."
            raise ScenarioError(f"{where}{key}", f"unknown key, with the value {shown(given[key])}.{hint}")
