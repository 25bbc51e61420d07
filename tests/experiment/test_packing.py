"""The folder of an experiment as one file, which may come from a stranger."""

import io
import os
import signal
import stat
import struct
import subprocess
import sys
import zipfile

import pytest
from small_hunts import HUNT
from typer.testing import CliRunner

from gamms import cli, experiment
from gamms.errors import BadFile, BadValue, TooLarge, WriteConflict
from gamms.folders import lock_folder
from gamms.limits import allowing


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of an experiment, with recordings in a folder below."""
    folder = tmp_path_factory.mktemp("hunts")
    experiment.run(HUNT, range(3), {"teams.red.count": [1, 2]}, out=folder)
    folder.joinpath("games").mkdir()
    folder.joinpath("games", "ä.ggr").write_bytes(b"\0" * 1000)
    return folder


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_is_restored_and_its_games_are_played(folder, tmp_path):
    count = experiment.pack(folder, tmp_path / "study.zip")
    assert count == experiment.unpack(tmp_path / "study.zip", tmp_path / "new" / "restored") == len(contents(folder))
    restored = tmp_path / "new" / "restored"
    assert contents(restored) == contents(folder)
    rows = experiment.load(restored)
    assert rows.sha256() == experiment.load(folder).sha256()
    assert rows.play(4).turns == rows[4]["turns"]


def test_the_same_folder_makes_the_same_bytes(folder, tmp_path):
    experiment.pack(folder, tmp_path / "first.zip")
    experiment.unpack(tmp_path / "first.zip", tmp_path / "copy")
    for file in (tmp_path / "copy").rglob("*"):
        os.utime(file, (10**9, 10**9))
    tmp_path.joinpath("copy", "rows.csv").chmod(0o600)
    experiment.pack(tmp_path / "copy", tmp_path / "second.zip")
    assert (tmp_path / "first.zip").read_bytes() == (tmp_path / "second.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "first.zip") as packed:
        assert packed.namelist() == sorted(contents(folder))


def test_folders_that_cannot_be_packed_are_refused(folder, tmp_path):
    with pytest.raises(BadFile, match=r"has no experiment\.json"):
        experiment.pack(tmp_path, tmp_path.parent / "x.zip")
    with pytest.raises(BadValue, match="Name a file elsewhere"):
        experiment.pack(folder, folder / "x.zip")
    with lock_folder(folder), pytest.raises(WriteConflict):
        experiment.pack(folder, tmp_path / "x.zip")
    experiment.run(HUNT, range(1), out=tmp_path / "hunts")
    (tmp_path / "hunts" / "secret").symlink_to(folder / "rows.csv")
    with pytest.raises(BadFile, match="a link"):
        experiment.pack(tmp_path / "hunts", tmp_path / "x.zip")
    (tmp_path / "hunts" / "secret").unlink()
    (tmp_path / "hunts" / "a:b").write_text("")
    with pytest.raises(BadFile, match="cannot be packed: its name has a sign"):
        experiment.pack(tmp_path / "hunts", tmp_path / "x.zip")
    assert not (tmp_path / "x.zip").exists()


def entry(name, mode=stat.S_IFREG | 0o644):
    about = zipfile.ZipInfo(name)
    about.external_attr = mode << 16
    return about


def foreign(path, *entries, data=b"{}"):
    """Write a file of a stranger's, with a plan."""
    with zipfile.ZipFile(path, "w") as packed:
        for one in (entry("experiment.json"), *entries):
            packed.writestr(one, data)
    return path


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    "names",
    [
        *(["../x"], ["a/../../x"], ["/tmp/x"], ["a//x"], ["./x"], ["a\\..\\x"], ["C:x"], ["a/"], ["a\nb"], ["a "]),
        *(["x", "x"], ["x", "X"], ["\u00e4", "a\u0308"], ["x", "x/y"], ["experiment.json/y"], ["/".join("abcdefghi")]),
        *(["n" * 201], [""]),
    ],
    ids=ascii,
)
def test_names_that_lead_elsewhere_are_refused_before_anything_is_written(tmp_path, names):
    path = foreign(tmp_path / "bad.zip", *map(entry, names))
    with pytest.raises(BadFile):
        experiment.unpack(path, tmp_path / "new")
    assert sorted(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFDIR, stat.S_IFCHR])
def test_a_path_that_is_not_a_file_is_refused(tmp_path, kind):
    path = foreign(tmp_path / "bad.zip", entry("x", kind | 0o777))
    with pytest.raises(BadFile, match="not a regular file"):
        experiment.unpack(path, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_bomb_is_refused_by_its_declared_size_and_cannot_hold_more(folder, tmp_path):
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("experiment.json", bytes(1 << 22))
    with allowing(1 << 20), pytest.raises(TooLarge, match="Unpacking"):
        experiment.unpack(tmp_path / "bomb.zip", tmp_path / "new")
    data = bytearray((tmp_path / "bomb.zip").read_bytes())
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = (1000).to_bytes(4, "little")  # the size that the table says
    (tmp_path / "liar.zip").write_bytes(data)
    with allowing(1 << 20), pytest.raises(BadFile, match="damaged"):
        experiment.unpack(tmp_path / "liar.zip", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    many = foreign(tmp_path / "many.zip", *(entry(f"{number}") for number in range(1000)))
    with allowing(1 << 20), pytest.raises(TooLarge, match="Reading"):
        experiment.unpack(many, tmp_path / "new")


def test_a_damaged_file_leaves_nothing(folder, tmp_path):
    experiment.pack(folder, tmp_path / "study.zip")
    data = (tmp_path / "study.zip").read_bytes()
    for number in range(0, len(data), 97):
        spoilt = bytearray(data)
        spoilt[number] ^= 0xFF
        (tmp_path / "bad.zip").write_bytes(spoilt)
        try:
            experiment.unpack(tmp_path / "bad.zip", tmp_path / "new")
        except (BadFile, TooLarge):
            assert not (tmp_path / "new").exists()
        else:  # what was changed is a time, say
            assert contents(tmp_path / "new").keys() == contents(folder).keys()
            for file in sorted((tmp_path / "new").rglob("*"), reverse=True):
                file.rmdir() if file.is_dir() else file.unlink()
            (tmp_path / "new").rmdir()
    for text in (b"", b"hello", data[:-1], data + b"x", data[: len(data) // 2]):
        (tmp_path / "bad.zip").write_bytes(text)
        with pytest.raises(BadFile):
            experiment.unpack(tmp_path / "bad.zip", tmp_path / "new")
    with zipfile.ZipFile(buffer := io.BytesIO(), "w") as packed:
        packed.writestr("x", b"")
    (tmp_path / "bad.zip").write_bytes(buffer.getvalue())
    with pytest.raises(BadFile, match=r"has no experiment\.json"):
        experiment.unpack(tmp_path / "bad.zip", tmp_path / "new")


def test_a_folder_that_is_not_empty_is_refused(folder, tmp_path):
    experiment.pack(folder, tmp_path / "study.zip")
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    for place in (tmp_path, tmp_path / "link"):
        with pytest.raises(BadValue, match="Name a new folder"):
            experiment.unpack(tmp_path / "study.zip", place)
    assert experiment.unpack(tmp_path / "study.zip", tmp_path / "empty") == len(contents(folder))


def test_the_commands_pack_and_unpack(folder, tmp_path):
    study, new = str(tmp_path / "study.zip"), tmp_path / "new"
    packed = CliRunner().invoke(cli.app, ["experiment", "pack", str(folder), study])
    assert packed.exit_code == 0
    assert f"with {len(contents(folder))} files" in packed.output
    bounded = CliRunner().invoke(cli.app, ["experiment", "unpack", study, str(new), "--max-memory", "1K"])
    assert bounded.exit_code == 1
    assert "--max-memory" in bounded.output
    assert not new.exists()
    assert CliRunner().invoke(cli.app, ["experiment", "unpack", study, str(new)]).exit_code == 0
    assert contents(new) == contents(folder)
    assert CliRunner().invoke(cli.app, ["experiment", "unpack", study, str(new)]).exit_code == 1


# -- killed programs, full disks ------------------------------------------------------------------------------------

DYING = """
import os, shutil, signal, sys
from gamms import experiment

copy, calls = shutil.copyfileobj, []


def copy_or_die(source, target, *size):
    calls.append(target)
    target.write(source.read(10))
    if len(calls) == int(sys.argv[1]):
        target.flush()
        os.kill(os.getpid(), signal.SIGKILL)
    copy(source, target, *size)


shutil.copyfileobj = copy_or_die
getattr(experiment, sys.argv[2])(sys.argv[3], sys.argv[4])
"""


def killed(number, function, source, target):
    """Let another program be killed while it copies a file."""
    words = [sys.executable, "-c", DYING, str(number), function, str(source), str(target)]
    assert subprocess.run(words, check=False).returncode == -signal.SIGKILL


@pytest.mark.skipif(sys.platform == "win32", reason="kills by signals")
@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("is_there", [False, True])
def test_a_killed_unpack_leaves_no_half_folder_and_the_next_one_leaves_no_rest(folder, tmp_path, number, is_there):
    experiment.pack(folder, tmp_path / "study.zip")
    new = tmp_path / "new"
    if is_there:
        new.mkdir(0o700)
    killed(number, "unpack", tmp_path / "study.zip", new)
    assert new.exists() == is_there
    assert not (new / "experiment.json").exists()
    assert experiment.unpack(tmp_path / "study.zip", new) == len(contents(folder))
    assert contents(new) == contents(folder)
    assert {one.name for one in tmp_path.iterdir()} == {"study.zip", "new"}
    assert not is_there or stat.S_IMODE(new.stat().st_mode) == 0o700


@pytest.mark.skipif(sys.platform == "win32", reason="kills by signals")
def test_a_killed_pack_leaves_the_old_file_and_the_next_one_leaves_no_rest(folder, tmp_path):
    file = tmp_path / "study.zip"
    file.write_bytes(b"old")
    killed(2, "pack", folder, file)
    assert file.read_bytes() == b"old"
    assert len([*tmp_path.iterdir()]) == 2
    experiment.pack(folder, file)
    assert [*tmp_path.iterdir()] == [file]
    assert experiment.unpack(file, tmp_path / "new") == len(contents(folder))


FULL = """
import resource, sys
from gamms import experiment

resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))
try:
    getattr(experiment, sys.argv[1])(sys.argv[2], sys.argv[3])
except OSError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize("function", ["pack", "unpack"])
def test_a_full_disk_is_told_with_the_name_of_the_file(folder, tmp_path, function):
    experiment.pack(folder, tmp_path / "study.zip")
    source = folder if function == "pack" else tmp_path / "study.zip"
    target = tmp_path / ("other.zip" if function == "pack" else "new")
    words = [sys.executable, "-c", FULL, function, str(source), str(target)]
    told = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    named = str(target) if function == "pack" else f"{target}/"
    assert told.startswith(f"[Errno 27] File too large: '{named}")
    assert ".part" not in told
    assert [*tmp_path.iterdir()] == [tmp_path / "study.zip"]


def with_offset(data, offset):
    """Return a ZIP file in which the last file begins elsewhere, by the field for large files."""
    at = data.rindex(b"PK\x01\x02")
    end = data.rindex(b"PK\x05\x06")
    entry = bytearray(data[at:end])
    name = int.from_bytes(entry[28:30], "little")
    field = struct.pack("<HHQ", 1, 8, offset)
    entry[42:46] = b"\xff" * 4
    entry[30:32] = len(field).to_bytes(2, "little")
    table = int.from_bytes(data[end + 12 : end + 16], "little") + len(field)
    tail = data[end : end + 12] + table.to_bytes(4, "little") + data[end + 16 :]
    return data[:at] + entry[: 46 + name] + field + tail


@pytest.mark.parametrize("offset", [5, 10**6, 2**32 - 1, 2**32, 2**63 - 1, 2**63, 2**64 - 1])
def test_a_place_beyond_the_file_is_refused(tmp_path, offset):
    data = foreign(tmp_path / "good.zip", entry("x")).read_bytes()
    (tmp_path / "bad.zip").write_bytes(with_offset(data, offset))
    with pytest.raises(BadFile, match=r"bad\.zip"):
        experiment.unpack(tmp_path / "bad.zip", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_file_in_the_place_of_the_folder_is_refused(folder, tmp_path):
    experiment.pack(folder, tmp_path / "study.zip")
    (tmp_path / "new").write_text("mine")
    for place in (tmp_path / "new", tmp_path / "new" / "below"):
        with pytest.raises(BadValue, match="it is not a folder"):
            experiment.unpack(tmp_path / "study.zip", place)
    assert (tmp_path / "new").read_text() == "mine"
