"""Files in the wrong place or of the wrong kind: the error names the folder, or the call that writes such files."""

from pathlib import Path

import pytest

import gamms
from gamms.errors import MissingFolder
from gamms.folders import made_folder
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
        made_folder(Path(folder)),
    ):
        pass
