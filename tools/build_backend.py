"""The build backend: that of setuptools, with a C compiler from the wheel `ziglang` where the machine has none.

pip asks a backend first which distributions a build needs besides those in pyproject.toml. Where neither a compiler of
the machine nor `ziglang` works, the build goes on without a compiler and `gamms.core` runs interpreted.
"""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 - the hooks that stay as they are

Settings = dict[str, str | list[str] | None] | None
ZIG = [sys.executable, "-m", "ziglang", "cc"]
PROBE = "#define Py_LIMITED_API 0x030B0000\n#include <Python.h>\nint probe(void) { return 0; }\n"
HEADERS = sysconfig.get_path("include")
MOST_SECONDS_TO_COMPILE = 120  # a compiler that cannot write its cache may wait forever
MOST_SECONDS_TO_FETCH = 300
EPOCH = "1580601600"  # the time of all files in a wheel, if the caller names none: 2 February 2020


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Return what the build of a wheel needs besides setuptools and Cython."""
    return [*_compiler(), *build_meta.get_requires_for_build_wheel(config_settings)]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """Return what an editable install needs besides setuptools and Cython."""
    return [*_compiler(), *build_meta.get_requires_for_build_editable(config_settings)]


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """Build a wheel, and return its name."""
    _prepare()
    return str(build_meta.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build the modules of the core in place and a wheel that refers to the checkout; return its name."""
    _prepare()
    for pattern in ("*.so", "*.pyd"):  # of an earlier build: this one may have none
        for file in Path("src/gamms/core").glob(pattern):
            file.unlink()
    return str(build_meta.build_editable(wheel_directory, config_settings, metadata_directory))


def _compiler() -> list[str]:
    """Return the distribution that holds a C compiler, if the machine has none and it can be had."""
    if not _compiles_nothing() and not _has_compiler() and Path(HEADERS, "Python.h").is_file() and _may_have_zig():
        return ["ziglang"]
    return []


def _prepare() -> None:
    """Choose the compiler, and see to it that the same text gives the same bytes."""
    os.umask(0o022)  # a wheel holds the modes of its files
    os.environ.setdefault("SOURCE_DATE_EPOCH", EPOCH)
    for folder in Path("build").glob("*"):  # of an earlier build: a wheel holds all that lies in `lib`
        if folder.name == "lib" or folder.name.startswith(("lib.", "bdist.")):
            shutil.rmtree(folder)
    if _compiles_nothing() or _has_compiler():
        return
    if _compiles(ZIG):
        os.environ["CC"] = shlex.join(ZIG)
        print("gamms: no C compiler works here; the core is compiled by ziglang", flush=True)
    else:
        os.environ["GAMMS_CORE_BUILD"] = "python"
        print("gamms: no C compiler works here; the core runs interpreted: the same games, slower", flush=True)


def _compiles_nothing() -> bool:
    return os.environ.get("GAMMS_CORE_BUILD") == "python"


def _has_compiler() -> bool:
    """Return whether the machine has a C compiler that works; Windows finds its own when it compiles."""
    if os.name == "nt":
        return True
    named = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    return _compiles(shlex.split(named))


def _compiles(compiler: list[str]) -> bool:
    """Return whether a command makes a shared library of a C file that includes Python.h."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "probe.c")
        library = Path(folder, "probe.so")
        source.write_text(PROBE, encoding="ascii")
        line = [*compiler, "-shared", "-fPIC", f"-I{HEADERS}", str(source), "-o", str(library)]
        try:
            done = subprocess.run(line, capture_output=True, check=False, timeout=MOST_SECONDS_TO_COMPILE)
        except (OSError, subprocess.TimeoutExpired):
            return False
        return done.returncode == 0 and library.is_file()


def _may_have_zig() -> bool:
    """Return whether `ziglang` can be had: an installation ends where a requirement of its build is missing."""
    base = Path(sys.base_prefix, "python.exe" if os.name == "nt" else f"bin/python3.{sys.version_info.minor}")
    for python in (sys.executable, str(base)):  # the environments of `build` have no pip
        if _succeeds([python, "-m", "pip", "--version"]):
            fetch = ["--dry-run", "--no-deps", "--ignore-installed", "--only-binary", ":all:", "ziglang"]
            return _succeeds([python, "-m", "pip", "install", *fetch])
    return True  # another front end, which will say what it lacks


def _succeeds(command: list[str]) -> bool:
    """Run a command outside of the environment of this build, from which pip is hidden by PYTHONPATH."""
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    try:
        done = subprocess.run(command, env=outside, capture_output=True, check=False, timeout=MOST_SECONDS_TO_FETCH)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0
