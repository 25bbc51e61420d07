"""Teams of many agents that are created, read and set together as arrays; agent objects are created on first access."""

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain, islice
from operator import length_hint
from typing import TYPE_CHECKING, Any, NoReturn, cast

import numpy as np

from gamms import kernels
from gamms.agent.agent import Agent, BaseAgent
from gamms.arguments import (
    as_array,
    as_bool,
    as_key,
    as_mapping,
    as_name,
    as_range,
    explain_misspelled,
    refuse_keywords,
)
from gamms.deciding import ContextPart, copy_part, get_phase
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir import events
from gamms.ir.agents import AgentBlock, read_speed
from gamms.ir.columns import Selection, remove_items
from gamms.ir.graph import IntArray, as_node_ids
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensor_results import LookResults
from gamms.kernels.draws import BitArray
from gamms.limits import max_memory, refuse_above
from gamms.text import make_printable_line, shown
from gamms.typing import IContext, IGraph
from gamms.typing.actions import as_heading, make_strategy
from gamms.typing.sensor_engine import ISensor, is_sensor

Column = np.ndarray[Any, Any]


def _check_speed(speed: Any, name: str) -> float | None:
    return None if speed is None else as_range(speed, name)


_OF_BLOCK: dict[str, Callable[[Any, str], Any]] = {"alive": as_bool, "speed": _check_speed}
"""Columns of agents in their block -> the check of a value."""
_NO_COLUMNS = frozenset({"name", "names", "node_ids", "agents", "start_node_id", "sensors", "team", "strategy"})
_NO_COLUMNS |= {"type", "agent_type"}
_MANY = 256  # number of members from which legal nodes are read from arrays of all edges
# measured, per member in columns and per agent object
_BYTES_PER_MEMBER = 450
_BYTES_PER_AGENT = 1_400
_OF_MEMBERS: dict[str, Callable[[Agent, Any], object]] = {
    "current_node_id": lambda agent, node: agent._check_node(node),
    "prev_node_id": lambda agent, node: agent._check_node(node),
    "orientation": lambda _, heading: heading is None or as_heading(heading),
    "team": lambda _, team: as_key(team, "A team"),
    "strategy": lambda agent, strategy: strategy is None or make_strategy(agent._ctx, strategy),
}
"""Other attributes that members check -> the same check, for all before one is set."""


class UncreatedMembers:
    """The members of a team whose objects do not exist yet: they have no sensors, and each has a row in the block.

    Attributes:
        names: names of all members.
        strategy: strategy of each member.
        columns: attributes, (agents,) each; members with an object have their own.
        made: members with an object by name, including those deleted later.
    """

    def __init__(self, names: tuple[str, ...], strategy: Any, columns: dict[str, Column]) -> None:
        self.names = names
        self.strategy = strategy
        self.columns = columns
        self.made: dict[str, Agent] = {}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Name -> index of the member."""
        return {name: number for number, name in enumerate(self.names)}

    def get_attributes(self, name: str) -> dict[str, Any]:
        """Return the attributes of a member without an object."""
        if not self.columns:
            return {}
        number = self.numbers[name]
        return {key: column[number : number + 1].tolist()[0] for key, column in self.columns.items()}

    def copy_members(self, columns: dict[str, Column] | None = None) -> "UncreatedMembers":
        """Return the members as if no objects had been created; with other attributes, if these are given."""
        given = self.columns if columns is None else columns
        return UncreatedMembers(self.names, self.strategy, {name: column.copy() for name, column in given.items()})


class Agents(dict[str, BaseAgent]):
    """Agents by name, in order of creation; a missing name raises an error that lists those that exist."""

    def __missing__(self, name: str) -> NoReturn:
        raise UnknownName("agent", name, self)


class AgentsByName(Agents):
    """All agents by name, in order of creation; `UncreatedMembers` stand in for agents without an object.

    Args:
        known: the agents.
        make: creates the object of a member by name.
    """

    def __init__(self, known: Mapping[str, Any], make: "Callable[[str, UncreatedMembers], BaseAgent]") -> None:
        super().__init__(known)
        self._make = make

    def __getitem__(self, name: str) -> BaseAgent:
        found: Any = super().__getitem__(name)
        return self._make_member(name, found) if type(found) is UncreatedMembers else found

    def get(self, name: Any, default: Any = None) -> Any:
        """Return an agent by name, or the default."""
        found: Any = super().get(name, default)
        return self._make_member(name, found) if type(found) is UncreatedMembers else found

    def __iter__(self) -> Iterator[str]:
        return super().__iter__()  # so that copies contain agents

    def values(self) -> Any:  # Any: dict's own view classes have no public name
        """Return all agents."""
        self._make_all()
        return super().values()

    def items(self) -> Any:  # as above
        """Return all names and agents."""
        self._make_all()
        return super().items()

    def copy(self) -> dict[str, BaseAgent]:
        """Return a plain dict of the agents."""
        return dict(self.items())

    def list_stored_items(self) -> ItemsView[str, Any]:
        """Return (name, agent or the `UncreatedMembers` it belongs to)."""
        return super().items()

    def get_created(self) -> dict[str, BaseAgent]:
        """Return name -> agent for agents with an object, in no order."""
        return {one.name: one for one in self.collect_stored() if type(one) is not UncreatedMembers}

    def collect_stored(self) -> set[Any]:
        """Return the agents with an object and the `UncreatedMembers` that stand in for others, each once."""
        return set(super().values())

    def get_stored(self) -> dict[str, Any]:
        """Return name -> the agent, or the `UncreatedMembers` that it belongs to."""
        return dict(self.list_stored_items())

    def _make_member(self, name: str, members: UncreatedMembers) -> BaseAgent:
        agent = self._make(name, members)
        super().__setitem__(name, agent)
        return agent

    def _make_all(self) -> None:
        for name, found in self.get_stored().items():
            if type(found) is UncreatedMembers:
                self._make_member(name, found)


class Team(ContextPart):
    """A team created by `ctx.agent.create_team`: agents `red_0`, `red_1`, …, in this order in all arrays.

    Members are ordinary agents, and stay in the team object when their team changes or they are deleted. The object of
    a member is created on first access; until then the member is a row in the columns of all agents.

    Attributes:
        name: name of the team.
        names: names of the members.
    """

    def __init__(self, ctx: IContext, name: str, members: UncreatedMembers, block_of: Callable[[], AgentBlock]) -> None:
        self._ctx = ctx
        self._phase = get_phase(ctx)
        self.name = name
        self.names = members.names
        self._members = members
        self._block_of = block_of
        self._rows: tuple[Any, Any] = None, None  # the block, and the result of `_select_members` for it
        self._draws = 0
        self._keys: BitArray | None = None  # keys of the names, for draws

    def __deepcopy__(self, memo: dict[int, Any]) -> "Team":
        """Return the team of a copy of the context; without such a copy, stay itself."""
        ctx = memo.get(id(self._ctx))
        if ctx is None:
            return self
        members: UncreatedMembers = memo.get(id(self._members)) or self._members.copy_members()
        memo[id(self._members)] = members
        for name, agent in self._members.made.items():
            members.made[name] = memo.get(id(agent)) or copy_part(agent, memo)
        twin = Team(ctx, self.name, members, lambda: ctx.agent.block)
        twin._draws = self._draws
        return twin

    def __repr__(self) -> str:
        """Return a text with the name and the number of agents."""
        return f"Team({self.name!r}, {len(self)} agents)"

    def __len__(self) -> int:
        return len(self.names)

    if not TYPE_CHECKING:  # type checkers report it themselves

        def __getattr__(self, name: str) -> object:
            """Refuse a name that is not an attribute of the team."""
            raise AttributeError(f"A team has no attribute {name!r}: team[{name!r}] is that of its members.")

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse to set attributes of the team object; `set` sets attributes of the members."""
        if name in vars(self) and name[0] != "_":
            raise AttributeError(f"team.{name} cannot be set: it is fixed when the team is created.")
        if name[0] != "_" and name not in ("name", "names"):
            raise AttributeError(f"team.{name} cannot be set: team.set({name!r}, …) sets the attribute of its members.")
        object.__setattr__(self, name, value)

    def __iter__(self) -> Iterator[Agent]:
        return map(self._get_agent, self.names)

    def __contains__(self, one: object) -> bool:
        """Return whether a name or an agent is a member."""
        if isinstance(one, Agent):
            return one.name in self._members.numbers and self._get_agent(one.name) is one
        return one in self._members.numbers if isinstance(one, str) else False

    @property
    def agents(self) -> list[Agent]:
        """The members."""
        return list(self)

    def _get_agent(self, name: str) -> Agent:
        found: Any = self._members.made.get(name) or self._ctx.agent.agents[name]
        return cast("Agent", found)

    def _select_members(self) -> tuple[Selection, dict[int, Agent]]:
        """Return the rows of the members, and the deleted members by index, ascending."""
        block = self._block_of()
        made = self._members.made
        if self._rows[0] != (block, block.rows.version):
            gone = [self._members.numbers[name] for name, one in made.items() if one._block is not block]
            deleted = {number: made[self.names[number]] for number in sorted(gone)}
            rows = Selection(block.rows.find_rows(remove_items(self.names, deleted)))
            self._rows = (block, block.rows.version), (rows, deleted)
        found: tuple[Selection, dict[int, Agent]] = self._rows[1]
        return found

    def _read_column(self, column: str) -> Any:
        """Return a column of the block for all members, (agents,); deleted members have their own blocks."""
        rows, deleted = self._select_members()
        values = rows.gather(getattr(self._block_of(), column))
        if deleted:
            values = list(values)
        for number, agent in deleted.items():
            values.insert(number, getattr(agent._block, column)[agent._row])
        return values

    @property
    def node_ids(self) -> IntArray:
        """The nodes of the members, (agents,) ids; read-only, use `move` to move them."""
        rows, deleted = self._select_members()
        block = self._block_of()
        nodes: Any = block.get_ids(rows.gather(block.node))
        if deleted:
            nodes = [*nodes]
        for number, agent in deleted.items():
            nodes.insert(number, agent.current_node_id)
        return _read_only(np.array(nodes, np.int64))

    @property
    def alive(self) -> BoolArray:
        """Whether each member takes part, (agents,); read-only, use `set` to change it."""
        return _read_only(np.array(self._read_column("alive"), np.bool_))

    def __getitem__(self, column: str) -> Column:
        """Return an attribute of all members, (agents,); read-only, use `set` to change it.

        Raises:
            UnknownName (KeyError): a member does not have the attribute.
            BadType: `column` is not a name.
        """
        if not isinstance(column, str):
            raise BadType(
                f"Index a team by the name of an attribute, not {shown(column)}; team.agents has the members."
            )
        members = self._members
        try:
            if column == "speed":
                values = np.array([*map(read_speed, self._read_column(column), self._read_column("has_int_speed"))])
            elif column in _OF_BLOCK:
                values = np.array(self._read_column(column))
            elif column in members.columns:
                own = {members.numbers[name]: getattr(agent, column) for name, agent in members.made.items()}
                values = _as_array(_change_values(members.columns[column], own).tolist())
            else:
                values = _as_array([getattr(agent, column) for agent in self])
        except AttributeError as error:
            known = self._list_attributes()
            if column in known:
                raise UnknownName(f"attribute of {error.obj!r}:", column) from None
            raise UnknownName("column", column, ["alive", "speed", *sorted(known)]) from None
        return _read_only(values)

    def set(self, column: str, values: object, where: object = None) -> None:
        """Set an attribute of members, with the checks and the recording of `agent.energy = 5`.

        Args:
            column: name of the attribute.
            values: one value for all members, or one for each, (agents,).
            where: mask (agents,) of the members to set; None: all.

        Raises:
            BadValue: the number of values is wrong, or a value is invalid; nothing has changed.
            BadType: `where` is not an array of booleans.
        """
        _refuse_fixed(column)
        chosen = np.ones(len(self), np.bool_) if where is None else as_array(where, "where= of a team", "booleans")
        if chosen.shape != (len(self),):
            raise BadType(f"where= of a team must be an array ({len(self)},) of booleans, not {shown(where)}.")
        changes_game = column in _OF_BLOCK or column in _OF_MEMBERS
        get_phase(self._ctx).refuse(f"set {column!r} of team {self.name!r}", changes_game=changes_game)
        listed = check_each(values, len(self), column)
        places = np.flatnonzero(chosen).tolist()
        members = self._members
        block = self._block_of()
        if column in _OF_BLOCK:
            checked = [_OF_BLOCK[column](listed[i], f"{column} of agent {self.names[i]!r}") for i in places]
            rows, deleted = self._select_members()
            if not deleted:
                for i, value in zip(places, checked, strict=True):
                    block.set(rows.rows[i], column, value)
                return
        for i in places if column in _OF_MEMBERS else ():
            _OF_MEMBERS[column](self._get_agent(self.names[i]), listed[i])
        has_column = column in members.columns
        if has_column or (where is None and not hasattr(Agent, column)):
            if not has_column:
                self._warn_of_misspelt(column)
            known = members.columns[column] if has_column else make_column(listed)
            members.columns[column] = _change_values(known, {i: listed[i] for i in places})
            self._note(column, [i for i in places if self.names[i] not in members.made])
            places = [i for i in places if self.names[i] in members.made]
        for i in places:
            setattr(self._get_agent(self.names[i]), column, listed[i])

    def _note(self, column: str, numbers: list[int]) -> None:
        """Record in the journal the values of members without an object."""
        block = self._block_of()
        if numbers and block.journal.notes_attributes:
            rows = block.rows.find_rows([self.names[i] for i in numbers])
            values = self._members.columns[column][numbers]
            block.journal.record_attribute(rows, column, values if values.dtype.kind in "biuf" else values.tolist())

    def _warn_of_misspelt(self, column: str) -> None:
        known = {*_OF_BLOCK, *_OF_MEMBERS, *self._list_attributes()}
        for hint in explain_misspelled([column], sorted(known), "attribute"):
            self._ctx.logger.warning(f"Team {self.name!r}: {hint} It is stored as an attribute.")

    def _list_attributes(self) -> Iterable[str]:
        """Return the names of the caller's attributes of members."""
        return {*self._members.columns, *(name for agent in self._members.made.values() for name in vars(agent))}

    def sense(self, sensor: str | ISensor) -> LookResults:
        """Read a sensor, given as an object or by id, at the positions of the members: one look for each.

        Raises:
            UnknownName (KeyError): the sensor does not exist.
            BadType: not a sensor.
        """
        one = self._ctx.sensor.get_sensor(sensor) if isinstance(sensor, str) else sensor
        if not is_sensor(one):
            raise BadType(f"A team senses with a sensor or its id, not {shown(sensor)}.")
        return one.sense_many(self.node_ids)

    def random_actions(self) -> IntArray:
        """Return a random legal node for each member, its own included, with equal probabilities: (agents,) ids.

        The draws depend on the seed of the context, the names, and the number of calls so far; strategies should draw
        from `state["draw"]` instead.
        """
        get_phase(self._ctx).refuse(f"draw the random_actions of team {self.name!r}")
        _, first, counts, ids_at = self._get_legal_nodes()
        purpose = kernels.compute_purpose_key(self._ctx.seed, "random_actions")
        if self._keys is None:
            self._keys = kernels.compute_name_keys(self.names)
        bits = kernels.draw_bits_rows(purpose, self._keys, self._draws)
        self._draws += 1
        return ids_at(first + kernels.convert_to_integers(bits, counts))

    def _get_legal_nodes(self) -> tuple[IntArray, IntArray, IntArray, Callable[[IntArray], IntArray]]:
        """Return the nodes of the members, and their legal nodes.

        Returns (nodes, first, count, ids_at): for each member its node, the position of its first legal node, and the
        number of legal nodes, (agents,) each; `ids_at` returns the node ids at given positions.
        """
        graph = self._ctx.graph
        nodes = self.node_ids
        # for few members this is cheaper than arrays of all edges, which are rebuilt when roads change
        if len(nodes) < _MANY:
            legal = [graph.graph.neighborhoods[node] for node in nodes.tolist()]
            counts = np.array([len(near) for near in legal], np.int64)
            ids = np.array([*chain.from_iterable(legal)], np.int64)
            return nodes, np.cumsum(counts) - counts, counts, ids.take
        routes = graph.routes
        node_ids = graph.columns().node_ids
        offsets, targets = routes.neighborhoods()
        rows = routes.rows(nodes)
        return nodes, offsets[rows], offsets[rows + 1] - offsets[rows], lambda places: node_ids[targets[places]]

    def move(self, node_ids: object) -> None:
        """Move all living members at once, each along at most one edge.

        Args:
            node_ids: target node of each member, (agents,).

        Raises:
            BadValue: a node is not legal, or the number of nodes is wrong; no member has moved.
        """
        get_phase(self._ctx).refuse(f"move team {self.name!r}")
        wanted = np.array(as_node_ids(node_ids, "node_ids", self._ctx.graph), np.int64)
        alive = self.alive
        if len(wanted) != len(self):
            raise BadValue(f"Team {self.name!r} has {len(self)} agents, and {len(wanted)} node_ids were given.")
        self._refuse_illegal(wanted, alive)
        rows, deleted = self._select_members()
        block = self._block_of()
        is_there = alive.copy()
        is_there[[*deleted]] = False
        if not is_there.all():
            rows = Selection(rows.array[np.delete(is_there, [*deleted])].tolist())
        nodes = wanted[is_there]
        block.move_all(rows, nodes.data)
        for i, agent in deleted.items():
            if alive[i]:
                agent._block.move(agent._row, int(wanted[i]))

    def _refuse_illegal(self, wanted: IntArray, alive: BoolArray) -> None:
        """Raise BadValue if a node of `wanted` (agents,) is not legal for its living member."""
        nodes, first, counts, ids_at = self._get_legal_nodes()
        left = np.flatnonzero(alive)
        number = 0
        wrong = len(self)
        # compare the first legal node of each member, then the second, until all wanted nodes are found
        while len(left):
            is_left = counts[left] > number
            wrong = min(wrong, *left[~is_left][:1].tolist(), len(self))
            left = left[is_left]
            left = left[ids_at(first[left] + number) != wanted[left]]
            number += 1
        if wrong < len(self):
            raise BadValue(
                f"Agent {self.names[wrong]!r} cannot move to node {wanted[wrong]}: there is no edge from node "
                f"{nodes[wrong]}."
            )


def make_member(ctx: IContext, block: AgentBlock, name: str, members: UncreatedMembers) -> Agent:
    """Return a member of a team as an agent object, which is a view of its row."""
    agent = Agent.__new__(Agent)
    near = agent._begin(ctx, block, ()).neighborhoods
    for key, value in (("_near", near), ("_row", block.find_row(name)), ("strategy", members.strategy)):
        object.__setattr__(agent, key, value)
    for key, value in members.get_attributes(name).items():
        agent._put_attribute(key, value)
    members.made[name] = agent
    return agent


def is_attribute(column: str) -> bool:
    """Return whether a column of a team is a custom attribute, which agents store unchanged."""
    return not hasattr(Agent, column)


def _refuse_fixed(column: str) -> None:
    """Raise an error for columns of a team that cannot be set."""
    if as_name(column, "an attribute") == "node_ids":
        raise BadValue("Place members on nodes with 'current_node_id', or move them with team.move(node_ids).")
    settable = {*_OF_BLOCK, *_OF_MEMBERS}
    if column not in settable and not is_attribute(column):
        raise BadValue(f"{column!r} of agents cannot be set; {', '.join(sorted(settable))} and custom names can.")


def make_column(values: list[Any]) -> Column:
    """Return one value per agent as an array; an array of objects unless all are of one kind of number."""
    kinds = set(map(type, values))
    kind = next(iter(kinds)) if len(kinds) == 1 else object
    try:
        if kind in (bool, int, float):
            return np.array(values, kind)
    except OverflowError:
        pass
    column = np.empty(len(values), object)
    column[:] = values
    return column


def _change_values(column: Column, values: Mapping[int, Any]) -> Column:
    """Return a copy of a column with other values at some positions."""
    if not values:
        return column
    listed = column.tolist()
    for number, value in values.items():
        listed[number] = value
    return make_column(listed)


def _as_array(values: list[Any]) -> Column:
    """Return the values of all members as an array, unchanged if NumPy would make texts of numbers."""
    try:
        found = np.array(values)
    except ValueError:
        found = None
    if found is None or (found.dtype.kind == "U" and not all(isinstance(value, str) for value in values)):
        found = np.empty(len(values), object)
        found[:] = values
    return found


def _read_only(values: Column) -> Column:
    values.setflags(write=False)
    return values


def check_starts(given: object, graph: IGraph, *, are_made: bool) -> list[int]:
    """Return the start nodes of a team's members, from any collection of ids of nodes of a graph.

    Raises:
        BadType, BadValue: the starts are not a list of integers.
        TooLarge (ValueError): the members would not fit into memory; they are counted before they are read.
    """
    each = _BYTES_PER_AGENT if are_made else _BYTES_PER_MEMBER
    most = max_memory() // each
    more = ""
    if isinstance(given, Iterator):
        given = list(islice(given, most + 1))
        more = " or more"
    try:
        count = length_hint(given)
    except OverflowError:  # a range of more than 64 bits
        count = 1 << 63
    refuse_above(count * each, f"A team of {count}{more} agents, of which {most} would fit,")
    return as_node_ids(given, "start_node_ids", graph)


def note_created(block: AgentBlock, names: Sequence[str], given: Iterable[dict[str, Any]]) -> None:
    """Record the creation of the last agents of a block, each with its keywords, as if they were created one by one."""
    journal = block.journal
    first = len(block.names) - len(names)
    if journal.is_silent:
        return
    for row, (name, keywords) in enumerate(zip(names, given, strict=True), first):
        journal.number_agent(row, name)
        journal.note(events.AGENT_CREATE, {"name": name, "kwargs": keywords, "state": {}})


def check_values(columns: object, count: int, others: Iterable[str]) -> dict[str, list[Any]]:
    """Return the columns of a team as name -> one plain value for each agent.

    Raises:
        BadType, BadValue: a column is not an attribute of agents, or has a wrong number of values.
    """
    lost = next((f" Members get it by columns={{{name!r}: …}}." for name in others if name not in _NO_COLUMNS), "")
    refuse_keywords(others, ("sensors", "strategy", "columns"), "create_team", lost)
    given = as_mapping(columns, "columns")
    for column in given:
        if as_name(column, "a column") in _NO_COLUMNS:
            raise BadValue(
                f"{column!r} cannot be one of columns=: it follows from the other arguments of create_team. Use them, "
                "or another name."
            )
    return {column: check_each(value, count, column) for column, value in given.items()}


def check_each(values: object, count: int, name: str) -> list[Any]:
    """Return one plain value for each of several agents.

    Raises:
        BadValue: the number of values differs from the number of agents.
    """
    are_many = isinstance(values, Sequence | Iterator) or np.ndim(values) > 0  # type: ignore[arg-type] # anything
    if isinstance(values, Mapping | str | bytes) or not are_many:
        return [values.item() if isinstance(values, np.generic) else values] * count
    listed: list[Any] = values.tolist() if isinstance(values, np.ndarray) else list(values)  # type: ignore[call-overload]
    if len(listed) != count:
        raise BadValue(f"{make_printable_line(name)}: one value, or {count}, one for each agent; not {len(listed)}.")
    return listed
