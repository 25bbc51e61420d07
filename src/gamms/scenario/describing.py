"""Documents about scenarios: the ODD protocol, in Markdown or as a page, and the differences between two scenarios.

ODD is the standard form in which agent-based models are described: Grimm et al., "The ODD protocol for describing
agent-based and other simulation models: a second update", JASSS 23(2), 2020. The texts are those of the schema, and of
the docstrings of the functions that a scenario names; code of users is read, and not run.
"""

import ast
import html
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from hashlib import file_digest
from pathlib import Path

from gamms import osm
from gamms import sensor as sensors
from gamms.core import draws, turn
from gamms.game import conflicts, game
from gamms.game.result import Result
from gamms.game.settings import Settings
from gamms.graph.storage import MapSnapshot
from gamms.ir import events
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.ir.schema import COLUMNS
from gamms.scenario import maps
from gamms.scenario import spec as schema
from gamms.scenario.code import CodeReference, find_offered_function, list_plain_defaults
from gamms.scenario.documents import describe_path, join_path
from gamms.scenario.placement import list_members
from gamms.scenario.spec import (
    Spec,
    Values,
    as_builtins,
    find_mappings,
    get_default,
    has_mapping,
    list_given_keys,
    list_key_texts,
    list_keys,
    list_mappings,
    to_plain,
)
from gamms.scenario.validation import NamedCode, find_sensor_type, list_code
from gamms.text import as_digits, find_summary, make_printable_line, parse_entries, parse_syntax, split_paragraphs
from gamms.typing.agent_engine import IAgentEngine
from gamms.typing.game import ChannelOptions
from gamms.typing.sensor_engine import DetectionOptions, PlaceOptions, SensorOptions
from gamms.versions import __version__

ODD = "odd"
FORMATS = (ODD,)
_INTRODUCTION = "This description follows the ODD protocol (Overview, Design concepts, Details; Grimm et al. 2020)."
_PLACING = ("count", "near", "within", "apart", "from")  # keys of a team
_LONGEST = 500  # characters of a value
_SPECIAL = re.compile(r"([\\`*_\[\]<>|#~&])")
_PHASE = re.compile(r"\| ([a-z ]*?) *\| (.*?) *\|")  # the first columns of the table of phases
_EXPLAINED: Mapping[type, tuple[object, ...]] = {  # mapping of the schema -> what its keys are the arguments of
    schema.Settings: (Settings,),
    schema.Channel: (ChannelOptions,),
    schema.Sensor: (PlaceOptions, DetectionOptions, SensorOptions),
    schema.Conflicts: (conflicts.Conflicts,),
    schema.AgentKeys: (IAgentEngine.create_agent,),
    schema.Rule: (game.Game.add,),
    schema.Helsinki: (osm.helsinki,),
    schema.StreetMap: (osm.graph_from_file,),
}
_MEANINGS = {  # of the columns of agents, by their names in the schema
    "names": "its name",
    "numbers": "its number in recordings",
    "kind": "on the ground, or in the air",
    "node": "the node on which it is, or that it passed last; in the air, the nearest",
    "previous": "the node on which it was before",
    "heading": "the direction in which it looks, (cos, sin), if it was set; otherwise that of its last move",
    "position": "in the air: (x, y, z), map units",
    "previous_position": "in the air: the position before the last flight",
    "quat": "in the air: the rotation, a unit quaternion (w, x, y, z)",
    "alive": "whether it takes part",
    "progress": "its place on an edge: the edge, and the covered share of its length",
    "teams": "its team",
    "speed": "how far it may move in a turn",
    "modes": "the edge attribute that says which edges it may use, and whether it obeys turn restrictions",
    "sensors": "the sensors that it carries",
    "attributes": "other values that code has set on it",
    "strategies": "the function that decides for it",
}
_CHANGED_BY = {  # columns of agents without an event of their own -> the event that changes them
    "position": events.AERIAL_AGENT_FLIGHT,
    "previous_position": events.AERIAL_AGENT_FLIGHT,
    "quat": events.AERIAL_AGENT_TURN,
    "progress": events.AGENT_PROGRESS,
    "sensors": events.AGENT_SENSOR_REGISTER,
    "attributes": events.AGENT_ATTRIBUTE,
    "strategies": events.AGENT_STRATEGY,
}
_STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em; }
table { border-collapse: collapse; margin: 1em 0; } th, td { padding: .25em .7em; border-bottom: 1px solid #8886; }
th, td { text-align: left; vertical-align: top; overflow-wrap: anywhere; }
"""


class OddDocument:
    """The description of a scenario by the ODD protocol, as Markdown.

    Args:
        spec: the scenario.
        raw: its values, as they are written.
        code: the code that it names, in the order of `list_code`.
        folder: the folder of its files; None: it has none.
        map: the map; None: it was not loaded.
        starts: the starting nodes of the agents with the seed of the scenario; empty: they are not known.
    """

    def __init__(
        self,
        spec: Spec,
        raw: Values,
        code: Sequence[CodeReference],
        folder: Path | None,
        map: MapSnapshot | None,
        starts: Mapping[str, IntArray],
    ) -> None:
        self._spec = spec
        self._raw = raw
        self._code = [*zip(list_code(spec), code, strict=True)]
        self._folder = folder
        self._map = map
        self._starts = starts
        self._used = find_mappings(spec)

    def write(self) -> str:
        """Return the document."""
        name = self._spec.name or "A game without a name"
        parts = [
            f"# {_escape(name)}: model description",
            f"{_INTRODUCTION} GAMMS {__version__} made it from the scenario; the last section has all keys.",
            "## 1 Purpose and patterns",
            _escape(self._spec.description or "The scenario has no key description, which would say it here."),
            "## 2 Entities, state variables, and scales",
            *self._write_entities(),
            "## 3 Process overview and scheduling",
            *self._write_processes(),
            "## 4 Design concepts",
            *self._write_concepts(),
            "## 5 Initialization",
            *self._write_initialization(),
            "## 6 Input data",
            *self._write_inputs(),
            "## 7 Submodels",
            *self._write_submodels(),
            "## 8 Keys of the scenario",
            *self._write_keys(),
        ]
        return "\n\n".join(part for part in parts if part) + "\n"

    # -- overview -------------------------------------------------------------------------------------------------

    def _write_entities(self) -> Iterator[str]:
        yield "### Map"
        yield _write_table(("fact", "value"), self._list_map_facts())
        yield "### Teams and agents"
        rows = []
        for name, agents in list_members(self._spec).items():
            team = self._spec.teams[name]
            decides = team.plan if team.plan is not None else team.strategy
            kinds = ", ".join(dict.fromkeys(str((one.listed and one.listed.type) or team.type) for one in agents))
            names = _cut(", ".join(one.name for one in agents))
            rows.append((name, str(len(agents)), names, kinds.replace("None", "basic"), _name_code(decides)))
        yield _write_table(("team", "agents", "names", "type", "decided by"), rows)
        yield "### State variables"
        header = ("of", "variable", "meaning", "changes are known to, while the game is played")
        yield _write_table(header, _list_variables(), is_prose=True)
        yield "### Scales"
        settings = self._spec.settings
        seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else None
        time = "a turn" if seconds is None else f"a turn of {as_digits(seconds)} seconds"
        limit = "until a rule ends it" if self._spec.max_turns is None else f"for at most {self._spec.max_turns} turns"
        yield f"Time passes in steps of {time}; a game is played {limit}."
        yield f"`speed_unit` is {_escape(settings.speed_unit)}: {_as_prose(_get_texts(schema.Settings)['speed_unit'])}"

    def _list_map_facts(self) -> Iterator[tuple[str, str]]:
        yield "kind", maps.find_map_kind(self._spec.map)
        yield "as written", _write_value(self._raw.get("map"))
        if self._map is None:
            yield "not loaded", "The map is made by code or a server. gamms scenario describe --build loads it."
            return
        columns = self._map.columns
        yield "nodes", f"{len(columns.node_ids):,}"
        yield "edges, each in one direction", f"{len(columns.edge_ids):,}"
        yield "length of all edges", f"{as_digits(round(float(columns.lengths.sum()), 3))} map units"
        low = columns.xy.min(axis=0)
        high = columns.xy.max(axis=0)
        yield "extent", " and ".join(f"{axis} from {low[i]:.2f} to {high[i]:.2f}" for i, axis in enumerate("xy"))
        yield "coordinates", columns.crs or "of a plane"
        yield "obstacles", f"{len({*self._map.obstacles.ids.tolist()}):,}"
        yield "SHA-256 of streets and obstacles", maps.compute_digest(columns, self._map.obstacles.corners)
        if self._map.attribution:
            yield "source", self._map.attribution

    def _write_processes(self) -> Iterator[str]:
        yield f"{_as_prose(split_paragraphs(turn.__doc__)[1])} Each turn has these phases, in this order:"
        yield _write_table(("phase", "what happens"), _list_phases())
        order = self._spec.settings.order
        if order is not None:
            groups = "; then ".join(" and ".join(group) for group in order)
            yield f"A turn has parts, in which teams decide and move: {_escape(groups)}."
        rules = [(named, code) for named, code in self._code if named.what == "rule"]
        rows = []
        for number, (named, code) in enumerate(rules, 1):
            rule = self._spec.rules[int(named.keys[1])]
            phase = rule.phase if isinstance(rule, schema.Rule) else "after"
            rows.append((str(number), _escape(code.wanted), phase, self._explain(named, code)))
        yield "Rules are applied in this order:" if rows else "The game has no rules."
        yield _write_table(("", "rule", "phase", "what it does"), rows, is_prose=True)

    # -- design concepts ------------------------------------------------------------------------------------------

    def _write_concepts(self) -> Iterator[str]:
        yield "### Adaptation, objectives, learning, and prediction"
        yield "Agents adapt through the strategies and plans of section 7, which hold their objectives."
        yield "### Sensing: who knows what"
        yield from self._write_sensing()
        yield "### Interaction"
        if self._spec.conflicts is None:
            yield "All moves are made: agents do not stand in each other's way. Rules let agents meet."
        else:
            yield _as_prose(" ".join(split_paragraphs(conflicts.Conflicts.__doc__)))
            yield self._write_part_table("conflicts")
        yield "### Stochasticity"
        yield f"{find_summary(draws.__doc__)} The seed of the scenario is {_write_value(self._spec.seed)}."
        yield _write_table(("drawn", "because of"), self._list_draws())
        yield "### Observation"
        yield find_summary(Result.__doc__)
        yield _write_table(("part of the result", "content"), parse_entries(Result.__doc__).items(), is_prose=True)

    def _write_sensing(self) -> Iterator[str]:
        rows = []
        for path, sensor in self._list_sensors():
            name = str(sensor.type or sensor.function)
            given = {key: value for key, value in list_given_keys(sensor).items() if key not in ("type", "function")}
            rows.append((_escape(path), _escape(name), _escape(_write_value(given)), self._explain_sensor(sensor)))
        yield "Agents have these sensors:" if rows else "Agents have no sensors."
        yield _write_table(("sensor", "kind", "parameters", "what it reports"), rows, is_prose=True)
        bearers = []
        for name, team in self._spec.teams.items():
            bearers.append((f"team {name}", ", ".join(team.sensors or ()) or "none"))
            own = [one for one in team.agents if one.sensors is not None]
            bearers += [(one.name, ", ".join(one.sensors or ()) or "none") for one in own]
        yield _write_table(("agents", "their sensors"), bearers)
        if self._spec.channels:
            yield "Agents send messages by these channels:"
            yield _write_table(
                ("channel", "keys"), ((name, _write_value(list_given_keys(one))) for name, one in self._list_channels())
            )
        else:
            yield "Agents send no messages."
        known = ", ".join(map(str, self._spec.facts)) or "none"
        yield f"Facts that all strategies know: {_escape(known)}."
        for key in ("information", "team_memory"):
            value = _write_value(getattr(self._spec.settings, key))
            yield f"`{key}` is {_escape(value)}: {_as_prose(_get_texts(schema.Settings)[key])}"

    def _list_sensors(self) -> list[tuple[str, schema.Sensor]]:
        return [(path, one) for path, one in self._used[schema.Sensor] if isinstance(one, schema.Sensor)]

    def _list_channels(self) -> Iterable[tuple[str, schema.Channel]]:
        return self._spec.channels.items()

    def _list_draws(self) -> Iterator[tuple[str, str]]:
        """Yield the random draws in games of this scenario, and the keys or functions that make them."""
        drawn = [name for name, team in self._spec.teams.items() if _is_placed(team)]
        if drawn:
            yield "the nodes on which agents start", ", ".join(f"teams.{name}" for name in drawn)
        for path, sensor in self._list_sensors():
            for key in ("detection", "position_noise_m", "false_alarm_rate"):
                if getattr(sensor, key) is not None:
                    yield "reports of sensors", join_path(path, key)
        for name, channel in self._list_channels():
            if channel.loss:
                yield "messages that are lost", f"channels.{name}.loss"
        if self._spec.conflicts is not None and self._spec.conflicts.resolve == "at_random":
            yield "winners of conflicts", "conflicts.resolve"
        functions = [code.text for named, code in self._code if named.what in ("strategy", "plan", "rule")]
        if functions:
            yield "draws of these functions, if they make any", ", ".join(dict.fromkeys(functions))

    # -- details --------------------------------------------------------------------------------------------------

    def _write_initialization(self) -> Iterator[str]:
        rows = []
        for name, team in self._spec.teams.items():
            given = list_given_keys(team)
            placing = {key: given[key] for key in _PLACING if key in given}
            listed = {one.name: "drawn" if one.node is None else as_builtins(one.node) for one in team.agents}
            rows.append((name, _write_value(placing), _write_value(listed) if listed else "-"))
        yield "Agents start as the keys of their teams say; nodes that these leave open are drawn."
        yield _write_table(("team", "keys", "nodes of listed agents"), rows)
        if self._starts:
            yield f"With the seed {_write_value(self._spec.seed)} they start on these nodes:"
            nodes = {name: int(found[0]) for name, found in self._starts.items()}
            by_team = [
                (team, {one.name: nodes[one.name] for one in own}) for team, own in list_members(self._spec).items()
            ]
            yield _write_table(("team", "nodes"), ((team, _write_value(own)) for team, own in by_team))
        for key in ("facts", "data"):
            values = getattr(self._spec, key)
            yield f"Initial `{key}`:" if values else f"There are no initial `{key}`."
            yield _write_table((key, "value"), ((str(name), _write_value(value)) for name, value in values.items()))

    def _write_inputs(self) -> Iterator[str]:
        files = dict.fromkeys(code.file for _, code in self._code if code.file is not None)
        map_file = maps.map_file(self._spec.map, self._folder)
        if map_file is not None:
            files = {map_file: None, **files}
        rows = [(_name_file(file, self._folder), _compute_hash(file)) for file in files]
        yield "The game reads these files:" if rows else "The game reads no files but that of the scenario."
        yield _write_table(("file", "SHA-256"), rows)

    def _write_submodels(self) -> Iterator[str]:
        if not self._code:
            yield "The scenario names no functions."
        for named, code in self._code:
            yield f"### {_escape(describe_path(named.path, self._raw))}: {_escape(code.text)}"
            yield self._explain(named, code, in_full=True)
            yield self._write_parameters(named, code)
        conflict = self._spec.conflicts
        if conflict is not None and isinstance(conflict.resolve, str) and ":" not in conflict.resolve:
            function = find_offered_function(conflict.resolve, "gamms.rules")
            yield f"### conflicts.resolve: {_escape(conflict.resolve)}"
            yield _as_prose(find_summary(getattr(function, "__doc__", "")))

    def _explain(self, named: NamedCode, code: CodeReference, *, in_full: bool = False) -> str:
        found = split_paragraphs(_find_docs(named, code)) or [f"{code.text} has no docstring."]
        return "\n\n".join(map(_as_prose, found if in_full else found[:1]))

    def _explain_sensor(self, sensor: schema.Sensor) -> str:
        if sensor.type is None:
            return "See section 7."
        kind = find_sensor_type(sensor.type)
        return _as_prose(find_summary(getattr(sensors, kind.name.lower()).__doc__ if kind else ""))

    def _write_parameters(self, named: NamedCode, code: CodeReference) -> str:
        function = find_offered_function(named.reference, named.short)
        defaults = {} if function is None else list_plain_defaults(function)
        texts = parse_entries(_find_docs(named, code))
        rows = []
        for name in dict.fromkeys([*named.given, *defaults]):
            value = _write_value(named.given.get(name, defaults.get(name)))
            origin = "given" if name in named.given else "default"
            rows.append((_escape(name), _escape(value), origin, _as_prose(texts.get(name, ""))))
        return _write_table(("parameter", "value", "", "meaning"), rows, is_prose=True)

    def _write_keys(self) -> Iterator[str]:
        yield "All keys of scenario files, with their values here and their defaults."
        for kind in list_mappings():
            yield f"### Keys of {kind.__name__}"
            yield _as_prose(find_summary(kind.__doc__))
            rows = []
            texts = _get_texts(kind)
            for key, field in list_keys(kind).items():
                values = [(path, getattr(part, field.name)) for path, part in self._used[kind]]
                values = [(path, value) for path, value in values if value != get_default(field)]
                given = [f"{path}: {_write_part(value)}" if path else _write_part(value) for path, value in values]
                default = "required" if field.required else _write_part(get_default(field))
                here = "; ".join(given) or "-"
                rows.append((_escape(key), _escape(_cut(here)), _escape(default), _as_prose(texts[key])))
            yield _write_table(("key", "here", "default", "meaning"), rows, is_prose=True)

    def _write_part_table(self, part: str) -> str:
        values = to_plain(getattr(self._spec, part))
        return _write_table(("key", "value"), ((key, _write_value(value)) for key, value in values.items()))


# -- the schema and the values of a scenario ----------------------------------------------------------------------


def _get_texts(kind: type) -> dict[str, str]:
    """Return the meaning of the keys of a mapping: by the schema, and by what the keys are arguments of."""
    texts: dict[str, str] = {}
    for part in reversed(kind.__mro__):
        for source in _EXPLAINED.get(part, ()):
            texts |= parse_entries(source.__doc__)
    return {**texts, **list_key_texts(kind)}


def _is_placed(team: schema.Team) -> bool:
    """Return whether the start of an agent of a team is drawn."""
    return bool(team.count) or any(one.node is None for one in team.agents)


def _name_code(value: object) -> str:
    if isinstance(value, schema.Code):
        return value.function
    return "no strategy of the scenario" if value is None else str(value)


def _list_variables() -> Iterator[tuple[str, str, str, str]]:
    """Yield the state variables of agents, teams and games: owner, name, meaning, and who knows of changes."""
    for column in COLUMNS:
        known = "it is fixed when the agent is created"
        if column.event is not None:
            known = column.event.audience.value
        elif column.name in _CHANGED_BY:
            known = events.EVENTS[_CHANGED_BY[column.name]].audience.value
        yield column.axis, _escape(column.attribute or column.name), _MEANINGS.get(column.name, ""), known
    meanings = parse_entries(GameState.__doc__)
    for field in fields(GameState):
        event = field.metadata["done"].event if "done" in field.metadata else None
        if event is not None:
            meaning = meanings[field.name].partition(";")[0]  # what follows is about how it is stored
            yield "game", _escape(field.name), _as_prose(meaning), event.audience.value


def _list_phases() -> list[tuple[str, str]]:
    """Return the phases of a turn, and what happens in each, from the table at the beginning of `core/turn.py`."""
    found: list[tuple[str, str]] = []
    for line in (turn.__doc__ or "").splitlines():
        row = _PHASE.match(line)
        if row is not None and row[1]:
            found.append((row[1], row[2]))
        elif row is not None:
            found[-1] = (found[-1][0], f"{found[-1][1]} {row[2]}")
    return found[1:]


def _find_docs(named: NamedCode, code: CodeReference) -> str | None:
    """Return the docstring of a function that a scenario names; code of users is parsed, and not run."""
    function = find_offered_function(named.reference, named.short)
    if function is not None:
        return function.__doc__
    if code.file is None:
        return None
    for node in parse_syntax(code.file.read_bytes(), str(code.file)).body:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) and node.name == code.wanted:
            return ast.get_docstring(node)
    return None


def _name_file(file: Path, folder: Path | None) -> str:
    return file.relative_to(folder).as_posix() if folder and file.is_relative_to(folder) else file.name


def _compute_hash(file: Path) -> str:
    with file.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()


# -- Markdown -----------------------------------------------------------------------------------------------------


def _write_value(value: object) -> str:
    return _cut(json.dumps(as_builtins(value), ensure_ascii=False, default=str))


def _write_part(value: object) -> str:
    return "below" if has_mapping(value) else _write_value(value)


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}… ({len(text):,} characters)"


def _escape(text: str) -> str:
    """Return a text as Markdown, on one line, without any markup."""
    return _SPECIAL.sub(r"\\\1", make_printable_line(" ".join(text.split("\n"))))


def _as_prose(text: str) -> str:
    """Return a text of a docstring as Markdown, on one line; words between single backquotes are code."""
    parts = text.split("`")
    if len(parts) % 2 == 0:
        return _escape(text)
    kinds = [
        _escape(part) if number % 2 == 0 else f"`{part.replace('|', chr(92) + '|')}`"
        for number, part in enumerate(parts)
    ]
    return "".join(kinds)


def _write_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, is_prose: bool = False) -> str:
    """Return a table; "" without rows. The cells are texts, or, with `is_prose`, Markdown."""
    lines = ["| " + " | ".join(row if is_prose else map(_escape, row)) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(header) + " |", "|---" * len(header) + "|", *lines])


def as_page(text: str, title: str) -> str:
    """Return Markdown as an HTML page without scripts; HTML in it is escaped."""
    from markdown_it import MarkdownIt

    policy = "default-src 'none'; style-src 'unsafe-inline'"
    head = (
        "<!doctype html>\n<html lang=en><meta charset=utf-8>"
        "<meta name=viewport content='width=device-width'>"
        f'<meta http-equiv=Content-Security-Policy content="{policy}">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style>\n<body>\n"
    )
    return f"{head}{MarkdownIt('js-default').render(text)}</body></html>\n"
