# Two commands for a newcomer: `make demo` plays a game, `make test` checks everything. Both set themselves up.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# What `gamms.core` is compiled from: an edit builds it again. The folder is newer than a file that was taken out of it.
CORE := setup.py src/gamms/core $(wildcard src/gamms/core/*.py src/gamms/core/*.pxd)
# Tests of what the core computes, and the laws of what rests on it.
CORE_TESTS := tests/core tests/kernels tests/rules
LAWS := $(CORE_TESTS) tests/batch tests/game

.PHONY: demo test test-core test-torch neighbors check bench docs figures format release-check lowest reproduce clean

demo: $(VENV)/.demo
	@$(BIN)/gamms --version
	$(BIN)/gamms demo

# Three processes for two cores: some tests wait for programs, locks and clocks, and others go on meanwhile.
# The laws hold interpreted, too; what needs a compiled core is left out then, and here where no C compiler was found.
test: $(VENV)/.dev
	@$(BIN)/gamms --version
	$(BIN)/python -m pytest -q -n 3 --dist worksteal
	GAMMS_CORE=python GAMMS_BRIEF=1 $(BIN)/python -m pytest -q -n 3 --dist worksteal -m law $(LAWS)

# The core with checks of bounds, then with the sanitizers of gcc or clang for addresses and undefined behavior.
test-core: $(VENV)/.dev
	rm -rf build/checked build/sanitized
	GAMMS_CORE_BUILD=checked $(BIN)/python setup.py --quiet build --build-lib build/checked
	PYTHONPATH=build/checked GAMMS_CORE=compiled $(BIN)/python -m pytest -q $(CORE_TESTS)
	GAMMS_CORE_BUILD=sanitized $(BIN)/python setup.py --quiet build --build-lib build/sanitized
	$(SANITIZED) -m pytest -q $(CORE_TESTS) tests/batch/test_threads.py tests/rl/test_turns_in_core.py
	$(SANITIZED) scripts/fuzz_calls.py --worlds 30
	$(SANITIZED) scripts/fuzz_recordings.py --count 5000 --games 100

# Python never frees some of its objects, and its own allocator would hide overruns. ASan looks for the library of C++ when
# it starts, before libraries that throw exceptions are loaded.
SANITIZED = PYTHONPATH=build/sanitized GAMMS_CORE=compiled PYTHONMALLOC=malloc ASAN_OPTIONS=detect_leaks=0 \
	LD_PRELOAD="$$($(CC) -print-file-name=libasan.so) $$($(CC) -print-file-name=libstdc++.so.6)" $(BIN)/python

# Learning with PyTorch, on the CPU.
test-torch: $(VENV)/.dev
	$(PIP) -e '.[torch,torchrl,train,onnx]' onnx
	$(BIN)/python -m pytest -q tests/rl

# The pages about TorchRL, BenchMARL, RLlib and OpenSpiel, followed in empty environments: they install gigabytes and train.
neighbors: $(BIN)/python
	$(BIN)/python scripts/check_neighbors.py

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python scripts/check_api.py

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/run.py

# The documentation as a site, which needs no network once its tools are installed. A warning is an error.
docs: $(VENV)/.docs
	@echo "This takes a few minutes: the games of the gallery are played for the site. The next time is quicker."
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs
	@echo "$(CURDIR)/build/docs/index.html"

figures: $(VENV)/.dev
	$(BIN)/python examples/figures.py docs/figures
	out=$$(mktemp -d) && $(BIN)/gamms demo --no-film --out $$out \
		&& $(BIN)/python scripts/animate_game.py $$out/game.ggr docs/demo.svg && rm -r $$out
	$(BIN)/python scripts/draw_architecture.py docs/figures
	GAMMS_REFRESH_EXAMPLES=1 $(BIN)/python -m pytest -q tests/docs/test_docs.py tests/playthroughs

# Measures again what benchmarks/README.md says, in under 30 minutes; raw data in reproduced/. Containerfile runs it, too.
reproduce: $(VENV)/.dev
	$(BIN)/python scripts/reproduce.py

# Builds the distribution and plays the README's games in empty environments; docs/releasing.md has more of it.
release-check: $(BIN)/python
	$(BIN)/python scripts/check_release.py

# The same with the lowest versions that pyproject.toml allows, without the extras that it names as large.
lowest: $(BIN)/python
	$(BIN)/python scripts/check_release.py --oldest --extras none all

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf src/gamms/core/*.so src/gamms/core/*.pyd src/*.egg-info
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "GAMMS needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# The demo plays on the bare library, too; what films it is left out where it cannot be installed.
$(VENV)/.demo: $(BIN)/python pyproject.toml $(CORE)
	@$(PIP) -e '.[viz,video]' \
		|| { echo "What paints and films cannot be installed here (see above); the demo is played without it."; \
		$(PIP) -e .; }
	@$(BIN)/python -m compileall -q src
	@touch $@

# After an edit of the core alone, by the C compiler of this machine; where it has none, as at first.
$(VENV)/.dev: $(BIN)/python pyproject.toml $(CORE)
	$(if $(filter-out $(CORE),$?),$(PIP) -e '.[dev]',$(REBUILD))
	@$(BIN)/python -m compileall -q src
	@touch $@ $(VENV)/.demo

IS_COMPILED = GAMMS_CORE=compiled $(BIN)/python -c 'import gamms.core' 2> /dev/null
REBUILD = $(BIN)/python setup.py --quiet build_ext --inplace && { $(IS_COMPILED) || $(PIP) --no-deps -e . || true; }

$(VENV)/.docs: $(BIN)/python pyproject.toml
	$(PIP) -e '.[docs,viz,accel,llm]'
	@$(BIN)/python -m compileall -q src
	@touch $@
