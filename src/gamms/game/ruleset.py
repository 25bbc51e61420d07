"""The rules of one game: named, in the order in which they are applied, and drawn by artists."""

from typing import Any, NamedTuple

from gamms.arguments import as_function_of, as_name
from gamms.errors import Duplicate, UnknownName
from gamms.ir.game_state import GameState
from gamms.typing.context import HostContext
from gamms.typing.game import Rule

PHASES = ("before", "after")


class NamedRule(NamedTuple):
    """A rule that was added to a game."""

    name: str
    rule: Rule
    phase: str  # "before" or "after"

    def __repr__(self) -> str:
        """Show the name and the phase."""
        return f"NamedRule({self.name!r}, phase={self.phase!r})"


class RuleSet:
    """The rules of one context's game.

    Attributes:
        rules: the rules in the order in which they were added; another tuple after each change.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self.rules: tuple[NamedRule, ...] = ()
        self._unchecked: list[NamedRule] = []

    def add(self, rule: Rule, phase: str, name: str | None) -> None:
        """Add a rule; see `Game.add`."""
        as_function_of(rule, "A rule", "the context")
        taken = {one.name for one in self.rules}
        if name is not None and as_name(name, "a rule") in taken:
            raise Duplicate("a rule", name)
        named = NamedRule(_free_name(_name_of(rule), taken) if name is None else name, rule, phase)
        prepare = getattr(rule, "prepare", None)
        if prepare is not None:
            prepare(self._ctx)
        self.rules = (*self.rules, named)
        self._unchecked.append(named)
        self._propose(named)

    def remove(self, wanted: str | Rule | NamedRule) -> None:
        """Remove a rule; see `Game.remove`."""
        for named in self.rules:
            if wanted in (named, named.name, named.rule):
                self.restore(tuple(one for one in self.rules if one is not named))
                return
        name = wanted if isinstance(wanted, str) else _name_of(wanted)
        raise UnknownName("rule", name, [named.name for named in self.rules])

    def restore(self, rules: tuple[NamedRule, ...]) -> None:
        """Replace all rules: the artists of those that go are removed, and those that come are drawn."""
        before, self.rules = self.rules, rules
        gone = {artist for named in before if named not in rules and (artist := _artist_of(named)) is not None}
        artists: Any = getattr(self._ctx.visual, "artists", None)  # an engine of the caller's may have none
        withdraw = self._ctx.visual.remove_artist if artists is None else artists.withdraw
        for artist in sorted(gone):
            withdraw(artist)
        for named in rules:
            if named not in before or _artist_of(named) in gone:
                self._propose(named)

    def apply(self, phase: str, state: GameState) -> None:
        """Call the rules of a phase, those that other rules add meanwhile too, and those that they remove no longer.

        A game that ends before a turn ends at once.
        """
        seen = rules = self.rules
        while rules:
            for named in rules:
                if named.phase == phase and (self.rules is seen or named in self.rules):
                    try:
                        named.rule(self._ctx)
                    except Exception as error:
                        error.add_note(f"In the rule {named.name!r} (phase {phase!r}), in turn {state.turn}.")
                        raise
                    if phase == "before" and state.over is not None:
                        return
            if self.rules is seen:
                return
            rules = tuple(one for one in self.rules if one not in seen)
            seen = (*seen, *rules)

    def warn_of_unknown_teams(self) -> None:
        """Warn about the teams that rules name and no agent plays for, once for each new rule."""
        if not self._unchecked:
            return
        for named in [one for one in self._unchecked if one in self.rules]:
            teams = self._ctx.agent.teams
            for team in getattr(named.rule, "teams", ()):
                if team not in teams:
                    self._ctx.logger.warning(f"{named.name}: {UnknownName('team', team, teams)} Nobody plays for it.")
        self._unchecked.clear()

    def _propose(self, named: NamedRule) -> None:
        artist = _artist_of(named)
        if artist is not None:
            drawer: Any = named.rule.drawer  # type: ignore[attr-defined] # rules that are drawn have one
            artists: Any = getattr(self._ctx.visual, "artists", None)
            propose = self._ctx.visual.add_artist if artists is None else artists.propose
            propose(artist, {"drawer": drawer, "layer": getattr(drawer, "layer", 12)})


def _artist_of(named: NamedRule) -> str | None:
    """Return the name of the artist that draws a rule; None if it is not drawn."""
    drawer = getattr(named.rule, "drawer", None)
    return None if drawer is None else str(getattr(drawer, "artist", f"rule_{named.name}"))


def _name_of(rule: object) -> str:
    while not hasattr(rule, "__name__") and hasattr(rule, "func"):  # functools.partial
        rule = rule.func
    return str(getattr(rule, "__name__", type(rule).__name__))


def _free_name(name: str, taken: set[str]) -> str:
    """Return the name, with the first number that makes it another one than those that are taken."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free
