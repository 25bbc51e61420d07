# Two commands for a newcomer: `make demo` plays a game, `make test` checks everything. Both set themselves up.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-torch check bench docs figures format release-check lowest reproduce clean

demo: $(VENV)/.demo
	$(BIN)/gamms demo

# Three processes for two cores: some tests wait for programs, locks and clocks, and others go on meanwhile.
test: $(VENV)/.dev
	$(BIN)/python -m pytest -q -n 3 --dist worksteal

# Learning with PyTorch, on the CPU.
test-torch: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[torch,torchrl,train,onnx]' onnx
	$(BIN)/python -m pytest -q tests/rl

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/run.py

# The documentation as a site, which needs no network once its tools are installed. A warning is an error.
docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs
	@echo "$(CURDIR)/build/docs/index.html"

figures: $(VENV)/.dev
	$(BIN)/python examples/figures.py docs/figures
	out=$$(mktemp -d) && $(BIN)/gamms demo --no-film --out $$out && cp $$out/final.svg docs/demo.svg && rm -r $$out
	$(BIN)/python scripts/draw_architecture.py docs/figures
	GAMMS_REFRESH_EXAMPLES=1 $(BIN)/python -m pytest -q tests/docs/test_docs.py

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
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "GAMMS needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# The demo plays on the bare library, too; what films it is left out where it cannot be installed.
$(VENV)/.demo: $(BIN)/python pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[viz,video]' \
		|| { echo "What paints and films cannot be installed here (see above); the demo is played without it."; \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .; }
	@$(BIN)/python -m compileall -q src
	@touch $@

$(VENV)/.dev: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@$(BIN)/python -m compileall -q src
	@touch $@ $(VENV)/.demo

$(VENV)/.docs: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs,viz,accel,llm]'
	@$(BIN)/python -m compileall -q src
	@touch $@
