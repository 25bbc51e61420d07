"""The table of system calls is right, and what a system cannot enforce is said."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from gamms.tournament import confinement
from gamms.tournament.scratch import ScratchLimitExceeded, check_folder, remove_folder
from gamms.tournament.system_calls import ABSENT, BOUND, FREE, MACHINES, STARTING, filter_for

HEADERS = {
    "x86_64": Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h"),
    "aarch64": Path("/usr/include/asm-generic/unistd.h"),
}
NAMES = {"newfstatat": "fstatat"}  # as the generic header has them
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="confined on Linux alone")


def numbers():
    """Return name -> numbers of all system calls in the tables."""
    bound = {name: one[0] for name, one in {**BOUND, **STARTING}.items()}
    return {**FREE, **bound, **ABSENT}


@pytest.mark.parametrize("machine", MACHINES)
def test_the_numbers_of_system_calls_are_those_of_the_headers_of_linux(machine):
    if not HEADERS[machine].exists():
        pytest.skip("there are no headers of Linux")
    found = re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", HEADERS[machine].read_text())
    known = {name: int(number) for name, number in found}
    column = MACHINES[machine][0]
    for name, both in numbers().items():
        number = known.get(name, known.get(NAMES.get(name)))
        is_newer = number is None and both[0] == both[1] and both[0] > 450  # than the header
        assert both[column] == number or is_newer, name


@pytest.mark.parametrize("machine", MACHINES)
def test_a_filter_names_each_call_once_and_its_jumps_end_in_it(machine):
    column = MACHINES[machine][0]
    listed = [both[column] for both in numbers().values() if both[column] is not None]
    assert (
        len(listed)
        == len(set(listed))
        == sum(map(len, (FREE, BOUND, STARTING, ABSENT)))
        - len([1 for both in numbers().values() if both[column] is None])
    )
    program = filter_for(machine, 7)
    assert len(program) < 4096
    for place, (_, if_true, if_false, _) in enumerate(program):
        assert max(if_true, if_false) < 256
        assert place + 1 + max(if_true, if_false) <= len(program)


IN_CHILD = """
import json, os, sys
from unittest.mock import patch
from gamms.tournament import confinement

for landlock, has_filter in json.loads(sys.argv[1]):
    if (child := os.fork()) == 0:
        with patch.object(confinement, "MACHINES", confinement.MACHINES if has_filter else {}):
            missing = confinement.confine(confinement.ProcessLimits(1 << 30, 5), [], os.getcwd(), landlock)
        os.write(1, json.dumps(missing).encode() + b"\\n")
        os._exit(0)
    os.waitpid(child, 0)
"""


def lines_of(code, *words, cwd):
    """Return what a new Python prints, as lines of JSON."""
    printed = subprocess.check_output([sys.executable, "-c", code, *words], cwd=cwd)
    return [json.loads(line) for line in printed.splitlines()]


@ON_LINUX
def test_limits_that_a_system_cannot_enforce_are_named(tmp_path):
    known = {
        (0, True): ["files can be read"],
        (1, True): [],
        (6, True): [],
        (0, False): ["files can be read", "no network", "truncated", "signals"],
        (2, False): ["no network", "truncated", "signals"],
        (5, False): ["no network", "signals"],
        (6, False): ["no network"],
    }
    newest = confinement.find_landlock_version()
    systems = {(version, has_filter): words for (version, has_filter), words in known.items() if version <= newest}
    for missing, words in zip(
        lines_of(IN_CHILD, json.dumps(list(systems)), cwd=tmp_path), systems.values(), strict=True
    ):
        assert len(missing) == len(words)
        assert all(word in one for one, word in zip(missing, words, strict=True))


def test_a_folder_of_any_depth_names_and_modes_is_removed(tmp_path, monkeypatch):
    folder = tmp_path / "scratch"
    folder.mkdir()
    for name, count in (("in", 1300), ("x" * 250, 20)):
        monkeypatch.chdir(folder)
        for _ in range(count):
            Path(name).mkdir()
            os.chdir(name)
        Path("file").write_text("")
        Path("link").symlink_to(tmp_path)
        os.mkfifo("pipe")
        Path("hidden").mkdir(0)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "beside").write_text("stays")
    remove_folder(folder)
    assert [one.name for one in tmp_path.iterdir()] == ["beside"]


def test_a_folder_that_cannot_be_removed_is_left_with_one_line(tmp_path, caplog):
    (tmp_path / "file").write_text("")
    remove_folder(tmp_path / "file")
    assert re.fullmatch("The folder '.*/file' could not be removed: Not a directory\\.", caplog.messages[0])


def test_links_out_of_a_folder_do_not_count(tmp_path):
    folder = tmp_path / "scratch"
    folder.mkdir()
    (folder / "link").symlink_to("/")
    os.mkfifo(folder / "pipe")
    check_folder(str(folder), os.getpid())
    (folder / "file").write_bytes(bytes((1 << 24) + 1))
    with pytest.raises(ScratchLimitExceeded, match="more than 16,777,216 bytes"):
        check_folder(str(folder), os.getpid())


IN_GROUP = """
import json, os

from gamms.tournament.confinement import ControlGroups

groups = ControlGroups(1 << 26, 20)
if (eater := os.fork()) == 0:
    os._exit(len(bytearray(1 << 28)) == 0)
_, status = os.waitpid(eater, 0)
print(json.dumps([os.getpid(), len(groups._joined), status, groups.has_killed(), groups.has_killed()]))
"""


@ON_LINUX
def test_control_groups_bound_memory_where_they_can_be_made(tmp_path):
    [[launcher, joined, *found]] = lines_of(IN_GROUP, cwd=tmp_path)
    confinement.remove_empty_groups()
    assert not [one for parent in confinement._find_parent_groups() for one in parent.glob(f"gamms-{launcher}")]
    if joined == 0:
        pytest.skip("this user can make no control groups")
    assert found == [9, True, False]
