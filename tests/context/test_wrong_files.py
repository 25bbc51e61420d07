"""Files in the wrong place or of the wrong kind: the error names the folder, or the call that writes such files."""

from pathlib import Path

import pytest

import gamms
from gamms.errors import BadValue, MissingFolder
from gamms.folders import make_folder
from gamms.strategies import stay

needs_proc = pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder that takes no new files")


@pytest.fixture
def street():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3))
        ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=stay)
        yield ctx


WRITERS = {
    "a picture": (lambda ctx, folder: ctx.visual.save(folder / "x.svg"), "x.svg"),
    "a recording": (lambda ctx, folder: ctx.game.run(1, record=folder / "x.ggr"), "x.ggr"),
    "a recording without a suffix": (lambda ctx, folder: ctx.record.start(folder / "x"), "x.ggr"),
    "a result": (lambda ctx, folder: ctx.game.run(1).save(folder / "x.json"), "x.json"),
    "a graph": (lambda ctx, folder: ctx.graph.save(folder / "x.gamms"), "x.gamms"),
    "tables of a graph": (lambda ctx, folder: ctx.graph.export(folder / "x.csv"), "x_nodes.csv"),
}


@needs_proc
@pytest.mark.parametrize("kind", WRITERS)
def test_a_folder_that_takes_no_files_is_named(street, kind):
    write, name = WRITERS[kind]
    with pytest.raises(MissingFolder) as caught:
        write(street, Path("/proc"))
    said = f"'/proc/{name}' cannot be made: the folder '/proc' takes no new files. Choose another place."
    assert str(caught.value) == said


@pytest.mark.parametrize("kind", sorted(WRITERS.keys() - {"tables of a graph"}))
def test_a_folder_that_is_missing_is_named(street, tmp_path, kind):
    write, name = WRITERS[kind]
    with pytest.raises(MissingFolder, match=rf"There is no folder '.*there' to write '{name}' into. Create it first."):
        write(street, tmp_path / "there")


@needs_proc
@pytest.mark.parametrize("folder", ["/proc/x", "/proc/x/y"])
def test_a_folder_that_cannot_be_made_is_named(folder):
    with (
        pytest.raises(MissingFolder, match=rf"^'{folder}' cannot be made: the folder '/proc' takes"),
        make_folder(Path(folder)),
    ):
        pass


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("x.mp4", "`gamms render x.ggr x.mp4` makes 'x.mp4' of a recording."),
        ("x.gif", "`gamms render x.ggr x.gif` makes 'x.gif' of a recording."),
        ("x.html", "`gamms render x.ggr x.html` makes 'x.html' of a recording."),
        ("x.PNG", "`gamms render x.ggr x.PNG` makes 'x.PNG' of a recording."),
        ("x.svg", "`gamms render x.ggr x.svg` makes 'x.svg' of a recording."),
        ("x.pdf", "`gamms render x.ggr x.pdf` makes 'x.pdf' of a recording."),
        ("x.csv", "`gamms convert x.ggr x.csv` makes 'x.csv' of a recording."),
    ],
)
def test_a_recording_under_the_name_of_another_kind_of_file_is_refused(street, tmp_path, name, command):
    for record in (lambda path: street.game.run(1, record=path), street.record.start):
        with pytest.raises(BadValue) as caught:
            record(tmp_path / name)
        suffix = name[1:].lower()
        assert str(caught.value) == f"A recording is a file .ggr, not {suffix}: name it 'x.ggr'. {command}"
    assert list(tmp_path.iterdir()) == []
    assert street.game.turn == 0
    street.game.run(1, record=tmp_path / "game.v2")
    assert [path.name for path in tmp_path.iterdir()] == ["game.v2.ggr"]


def test_other_files_under_the_names_of_other_kinds_are_refused(street, tmp_path):
    with pytest.raises(BadValue, match=r"A result is a file .json, not .ggr: .* ctx.game.run\(record='x.ggr'\)"):
        street.game.run(1).save(tmp_path / "x.ggr")
    with pytest.raises(
        BadValue, match=r"A saved graph is a file .gamms, not .graphml: .* ctx.graph.export\('x.graphml'\)"
    ):
        street.graph.save(tmp_path / "x.graphml")
    with pytest.raises(BadValue, match=r"for a page, recording\.save"):
        street.visual.save(tmp_path / "x.html")
    assert list(tmp_path.iterdir()) == []
