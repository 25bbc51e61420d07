"""`gamms study`: serve a study to participants, as described in a file, until Ctrl-C."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gamms.cli.many import check_keys, import_strategies
from gamms.cli.output import echo, join_names, warn
from gamms.cli.play import HERE, Allow, KeyVariable, find_foreign_code
from gamms.errors import BadType, BadValue
from gamms.text import make_printable_line, shown

if TYPE_CHECKING:
    from gamms.web import Study

_REQUIRED = ("scenario", "consent")
_KEYS = (
    *_REQUIRED,
    "people",
    "conditions",
    "rounds",
    "practice",
    "seconds",
    "codes",
    "per_minute",
    "partner_within",
    "seed",
    "title",
    "instructions",
    "thanks",
)
_MOST_CONSENT = 1 << 16  # bytes


def study(  # noqa: PLR0913, PLR0917 - one argument per option
    file: Annotated[Path, typer.Argument(help="A study: YAML or JSON.", metavar="FILE", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The folder for the table and the recordings; by default FILE-results. A study that was ended goes on "
            "there.",
            metavar="FOLDER",
            show_default=False,
        ),
    ] = None,
    otherwise: Annotated[
        str | None,
        typer.Option(
            help="The strategy that decides where a participant does not: mine.py:strategy. By default they stay.",
            metavar="CODE",
            show_default=False,
        ),
    ] = None,
    take_out: Annotated[
        list[str] | None,
        typer.Option(
            "--take-out",
            help="Take a participant out of the study, also while it is served by another program: a code, or one with "
            "* for any letters. Nothing is served then.",
            metavar="CODE",
            show_default=False,
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="0 takes a free one.", metavar="PORT")] = 0,
    host: Annotated[str, typer.Option(help="The address to serve at.", metavar="HOST")] = HERE,
    allow_network: Annotated[
        bool, typer.Option("--allow-network", help="Let other machines in, at an address of this one.")
    ] = False,
    allow: Allow = None,
    key_variable: KeyVariable = None,
) -> None:
    """Let people take part in a study, in browsers."""
    from gamms import scenario, web
    from gamms.scenario import documents
    from gamms.scenario.code import find_function
    from gamms.web.participants import take_out as taken_out

    out = out or Path(f"{file.stem}-results")
    if take_out:
        taken_out(out, take_out)
        echo(f"Taken out of the study in {out}: {', '.join(take_out)}. Their rows stay in the table.")
        return
    with documents.name_errors(file):
        values: Any = check_keys(file, documents.read(file), "study", _REQUIRED, _KEYS)
    paths = {key: file.parent / _read_text(file, key, values.pop(key)) for key in ("scenario", "consent")}
    game = scenario.load(paths["scenario"], allow or (), key_variable=key_variable)
    if otherwise is not None:
        values |= import_strategies({"otherwise": find_function(otherwise, "--otherwise")})
    for line in find_foreign_code(game, {}):
        echo(f"imports {make_printable_line(line)}")
    warn(game)
    values |= {"port": port, "host": host, "allow_network": allow_network}
    with (
        web.study(game, consent=_read_consent(paths["consent"]), out=out, **values) as running,
        suppress(KeyboardInterrupt),
    ):
        if running.codes is None:
            echo("The study is served until Ctrl-C. The link of a participant, with a code of theirs in place of CODE:")
            echo(f"  {running.url}")
        else:
            echo("The study is served until Ctrl-C. The links of the participants:")
            echo("\n".join(f"  {running.link(code)}" for code in running.codes))
        running.stay_open()
    echo(f"\n{_summarize(running)} The same command goes on.")


def _read_text(file: Path, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise BadType(f"{file}: {key} is the name of a file beside this one, not {shown(value)}.")
    return value


def _read_consent(file: Path) -> str:
    """Return the text that participants agree to.

    Raises:
        BadValue: the text is empty, too long, or not UTF-8.
        OSError: the file cannot be read.
    """
    with file.open("rb") as stream:
        data = stream.read(_MOST_CONSENT + 1)
    is_long = len(data) > _MOST_CONSENT
    try:
        text = "" if is_long else data.decode("utf-8-sig").strip()
    except UnicodeDecodeError as error:
        raise BadValue(f"{file}: the consent text is not UTF-8: {error}.") from None
    if not text:
        found = f"has more than {_MOST_CONSENT:,} bytes" if is_long else "has nothing in it"
        raise BadValue(f"{file}: the consent text {found}. It is what participants read, and agree to.")
    return text


def _summarize(running: "Study") -> str:
    """Return in words the contents of the results folder."""
    rows = running.rows
    folder = running.folder
    if not rows:
        return f"No round was played to its end; {folder} says how many have agreed: {sum(running.assigned.values())}."
    people = len({row["participant"] for row in rows})
    written = join_names([folder / "rows.csv", folder / "rows.jsonl", folder / "games"])
    return f"{len(rows):,} rounds of {people:,} participants are in {written}."
