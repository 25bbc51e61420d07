"""The extensions of `gamms.core`: one for each of its modules, for the stable ABI of CPython 3.11.

    python setup.py build_ext --inplace                                          # what an edit of the core needs
    GAMMS_CORE_BUILD=sanitized python setup.py build --build-lib build/sanitized  # the whole package, elsewhere

`GAMMS_CORE_BUILD` names the profile: `release`, `checked` (bounds), `sanitized` (ASan and UBSan), or `python`, which
compiles nothing. All else is in pyproject.toml.
"""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
from hashlib import sha256
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.errors import CCompilerError, PlatformError

CORE = Path("src/gamms/core")
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
FLAGS = {
    "release": ["-O3", "-g0"],
    "checked": ["-O1", "-g0"],
    "sanitized": ["-O1", "-g", "-fno-omit-frame-pointer", *SANITIZERS],
}
SHARED = "gamms.core._shared"
HAS_STABLE_ABI = sys.implementation.name == "cpython" and not sysconfig.get_config_var("Py_GIL_DISABLED")
PROFILE = os.environ.get("GAMMS_CORE_BUILD", "release") if HAS_STABLE_ABI else "python"
IS_WINDOWS = os.name == "nt"
C = Path("build", PROFILE)  # what is generated
COMPILED = C / "compiled"
DIRECTIVES = {
    "language_level": 3,
    "annotation_typing": False,
    "cdivision": False,
    "boundscheck": PROFILE == "checked",
    "initializedcheck": PROFILE == "checked",
    "wraparound": False,
}


def modules() -> dict[str, str]:
    """Return the modules that are compiled and their files.

    `_stamp` tells which text was compiled; `_shared` is the code of Cython for columns, else in each module once more.
    """
    names = sorted(file.stem for file in CORE.glob("*.pxd") if file.stem != "__init__")
    files = {name: CORE / f"{name}.py" for name in names} | {"_stamp": C / "_stamp.py", "_shared": C / "_shared.c"}
    return {f"gamms.core.{name}": file.as_posix() for name, file in files.items()}


def extension(name: str, file: str) -> Extension:
    """Return an extension that the library can do without."""
    return Extension(
        name,
        [file],
        define_macros=[("Py_LIMITED_API", "0x030B0000")],
        py_limited_api=True,
        extra_compile_args=["/O2", "/fp:precise"] if IS_WINDOWS else ["-ffp-contract=off", *FLAGS[PROFILE]],
        extra_link_args=SANITIZERS if PROFILE == "sanitized" else [],
        optional=True,
    )


class BuildPackage(build_py):
    """Copy the package into an empty folder: an earlier build may have files that are no longer in the source."""

    def run(self) -> None:
        """Remove what an earlier build left, and copy."""
        if not self.editable_mode:
            shutil.rmtree(Path(self.build_lib, "gamms"), ignore_errors=True)
        super().run()


class BuildCore(build_ext):
    """Compile the modules of the core that have changed; where one of them fails, none is used.

    Compiled modules are kept in `COMPILED`, each with a key of all that it was made from.
    """

    def run(self) -> None:
        """Compile what has changed, and put all modules where they belong if all of them are there."""
        extensions = self.extensions
        earlier = [Path(self.build_lib, self._file(one)) for one in extensions]
        for file in [*earlier, *built_in_place()] if self.inplace else earlier:
            file.unlink(missing_ok=True)
        try:
            self._compile_changed()
        except (CCompilerError, PlatformError) as error:  # such as Windows without a compiler
            self.warn(str(error))
        self.extensions = extensions
        if all((COMPILED / self._file(one)).is_file() for one in extensions):
            for one in extensions:
                target = Path(self.get_ext_fullpath(one.name))
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(COMPILED / self._file(one), target)
            return
        print("gamms: the core could not be compiled; it runs interpreted: the same games, slower", flush=True)
        self._forget()

    def _file(self, one: Extension) -> str:
        """Return the file of a compiled module, in the folder of what is built."""
        return str(self.get_ext_filename(one.name))

    def _compile_changed(self) -> None:
        """Compile the modules whose keys differ from those of the last build."""
        self._write_stamp()
        keys = self._keys()
        changed = [one for one in self.extensions if not self._is_kept(one, keys[one.name])]
        if not changed:
            return
        self.extensions = changed
        self._write_c()
        build_lib, in_place = self.build_lib, self.inplace
        self.build_lib, self.inplace = str(COMPILED), False
        self.force = True  # the keys say what has changed; neither Cython nor setuptools notices other flags
        try:
            super().run()
        finally:
            self.build_lib, self.inplace = build_lib, in_place
        for one in changed:
            file = COMPILED / self._file(one)
            if file.is_file():
                file.with_suffix(".key").write_text(keys[one.name], encoding="utf-8")

    def _is_kept(self, one: Extension, key: str) -> bool:
        """Return whether a module was compiled from the same; remove one that was compiled from something else."""
        file = COMPILED / self._file(one)
        known = file.with_suffix(".key")
        if file.is_file() and known.is_file() and known.read_text(encoding="utf-8") == key:
            return True
        file.unlink(missing_ok=True)
        known.unlink(missing_ok=True)
        return False

    def _keys(self) -> dict[str, str]:
        """Return a hash of all that each module is made from: texts, flags, and the versions of what compiles."""
        import Cython

        tools = f"{Cython.__version__} {sys.version} {sysconfig.get_platform()} {compiler_version()} {DIRECTIVES}"
        keys = {}
        for one in self.extensions:
            [source] = one.sources
            total = sha256(f"{tools} {one.extra_compile_args} {one.extra_link_args} {one.define_macros}".encode())
            own = [] if one.name == SHARED else [Path(source)]  # the version of Cython says what all modules share
            for file in [*own, *cimported(one.name.rpartition(".")[2])]:
                total.update(file.name.encode() + file.read_bytes())
            keys[one.name] = total.hexdigest()
        return keys

    def _write_stamp(self) -> None:
        """Write the stamp."""
        C.mkdir(parents=True, exist_ok=True)
        text = runpy.run_path(str(CORE / "form.py"))["digest"](CORE)
        (C / "_stamp.py").write_text(f'TEXT = "{text}"\nPROFILE = "{PROFILE}"\n', encoding="utf-8")

    def _write_c(self) -> None:
        """Let Cython write a C file for each module, and make it the source of its extension."""
        from Cython.Build import cythonize

        if any(one.name == SHARED for one in self.extensions):
            command = [sys.executable, "-m", "cython", f"--generate-shared={C / '_shared.c'}"]
            subprocess.run(command, check=True)
        written = cythonize(
            [Extension(one.name, one.sources) for one in self.extensions if not one.sources[0].endswith(".c")],
            build_dir=str(C),
            include_path=["src"],
            shared_utility_qualified_name=SHARED,
            force=True,
            show_all_warnings=False,
            compiler_directives=DIRECTIVES,
        )
        sources = {one.name: one.sources for one in written}
        for one in self.extensions:  # its own options stay: `cythonize` drops `optional`
            one.sources = sources.get(one.name, one.sources)

    def _forget(self) -> None:
        """Make the distribution one without extensions, and a wheel of it `py3-none-any`."""
        self.extensions = []
        self.distribution.ext_modules = []
        wheel = self.distribution.get_command_obj("bdist_wheel", create=False)
        if wheel is not None:
            wheel.root_is_pure = True
            wheel.py_limited_api = False


def cimported(name: str) -> list[Path]:
    """Return the `.pxd` file of a module and all others that it cimports, directly or not."""
    files = dict[Path, None]()
    names = [name]
    while names:
        file = CORE / f"{names.pop()}.pxd"
        if file.is_file() and file not in files:
            files[file] = None
            text = file.read_text(encoding="utf-8")
            names += re.findall(r"^from gamms\.core\.(\w+) cimport", text, re.MULTILINE)
            names += re.findall(r"\w+", " ".join(re.findall(r"^from gamms\.core cimport (.*)", text, re.MULTILINE)))
    return sorted(files)


def compiler_version() -> str:
    """Return what the C compiler says of itself; "" where it has no option for that."""
    command = shlex.split(os.environ.get("CC", "") or sysconfig.get_config_var("CC") or "")
    if not command or IS_WINDOWS:
        return ""
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False)
    return f"{command} {done.stdout}"


def built_in_place() -> list[Path]:
    """Return the compiled modules beside the text."""
    return [*CORE.glob("*.so"), *CORE.glob("*.pyd")]


if PROFILE == "python":
    setup(cmdclass={"build_py": BuildPackage})
else:
    setup(
        ext_modules=[extension(name, file) for name, file in modules().items()],
        cmdclass={"build_py": BuildPackage, "build_ext": BuildCore},
        options={"build_ext": {"parallel": os.cpu_count()}, "bdist_wheel": {"py_limited_api": "cp311"}},
    )
