"""The extensions of `gamms.core`: one for each of its modules, for the stable ABI of CPython 3.11.

    python setup.py build_ext --inplace                                          # what an edit of the core needs
    GAMMS_CORE_BUILD=sanitized python setup.py build --build-lib build/sanitized  # the whole package, elsewhere

`GAMMS_CORE_BUILD` names the profile: `release`, `checked` (bounds), `sanitized` (ASan and UBSan), or `python`, which
compiles nothing. All else is in pyproject.toml.
"""

import os
import runpy
import shutil
import subprocess
import sys
import sysconfig
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
HAS_STABLE_ABI = sys.implementation.name == "cpython" and not sysconfig.get_config_var("Py_GIL_DISABLED")
PROFILE = os.environ.get("GAMMS_CORE_BUILD", "release") if HAS_STABLE_ABI else "python"
IS_WINDOWS = os.name == "nt"
C = Path("build", PROFILE)  # what is generated


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
    """Compile all modules of the core or, where one of them fails, none."""

    def run(self) -> None:
        """Write the C, compile it, and see whether all of it is there."""
        self.force = True  # neither Cython nor setuptools notices other directives and flags
        in_place = self.inplace
        self.inplace = False
        built = [Path(self.build_lib, self.get_ext_filename(one.name)) for one in self.extensions]
        for file in [*built, *built_in_place()] if in_place else built:  # of an earlier build
            file.unlink(missing_ok=True)
        try:
            self._write_c()
            super().run()
        except (CCompilerError, PlatformError) as error:  # such as Windows without a compiler
            self.warn(str(error))
        self.inplace = in_place
        if all(file.is_file() for file in built):
            if in_place:
                self.copy_extensions_to_source()
            return
        print("gamms: the core could not be compiled; it runs interpreted: the same games, slower", flush=True)
        for file in built:
            file.unlink(missing_ok=True)
        self._forget()

    def _write_c(self) -> None:
        """Let Cython write a C file for each module, and make it the source of its extension."""
        from Cython.Build import cythonize

        C.mkdir(parents=True, exist_ok=True)
        text = runpy.run_path(str(CORE / "form.py"))["digest"](CORE)
        (C / "_stamp.py").write_text(f'TEXT = "{text}"\nPROFILE = "{PROFILE}"\n', encoding="utf-8")
        shared = C / "_shared.c"
        subprocess.run([sys.executable, "-m", "cython", f"--generate-shared={shared}"], check=True)
        is_checked = PROFILE == "checked"
        written = cythonize(
            [Extension(one.name, one.sources) for one in self.extensions if one.sources != [shared.as_posix()]],
            build_dir=str(C),
            include_path=["src"],
            shared_utility_qualified_name="gamms.core._shared",
            force=True,
            show_all_warnings=False,
            compiler_directives={
                "language_level": 3,
                "annotation_typing": False,
                "cdivision": False,
                "boundscheck": is_checked,
                "initializedcheck": is_checked,
                "wraparound": False,
            },
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
