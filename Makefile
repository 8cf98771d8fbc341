# Everything runs in one environment, .venv, which the first command that needs it sets up.
# `make PYTHON=python3.12 test` picks the interpreter, else the fastest of the version of python3 is taken;
# `make test PYTEST_FLAGS="-k twin"` hands flags to pytest.

PYTHON ?= $(shell python3 .ci/fastest_python.py)
PYTEST_FLAGS ?=
VENV := .venv
BIN := $(VENV)/bin
SETUP = $(PYTHON) -m venv $(VENV) && $(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt

.PHONY: help demo test test-long bench bench-base contest contest-small

help:  ## say what there is to make
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST)

# Stamps: the package is installed, and so is what its developers need. The second includes the first.
$(VENV)/.installed: pyproject.toml constraints.txt
	@echo "Setting up $(VENV), once; this takes a minute or two."
	@$(SETUP) --editable .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt
	@echo "Setting up $(VENV) with the developers' tools, once; this takes a minute or two."
	@$(SETUP) --editable ".[dev]"
	@touch $(VENV)/.installed $@

demo: $(VENV)/.installed  ## run the 16-module flying array over lossy infrared links, and say where its figures are
	$(BIN)/volery run dfa16-lossy
	@echo "Figures:"
	@find "$$(ls -d runs/*-dfa16-lossy* | tail -n 1)" -name '*.png' -o -name '*.pdf' | sort | sed 's/^/  /'

test: $(VENV)/.installed-dev  ## check style, types, import rules and spelling, then run the tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/codespell
	$(BIN)/pytest --numprocesses 2 --dist worksteal $(PYTEST_FLAGS)

test-long: $(VENV)/.installed-dev  ## run the tests that `make test` has in a shorter form: whole pages, a hundred runs
	$(BIN)/pytest --numprocesses 2 --dist worksteal -m long $(PYTEST_FLAGS)

bench: $(VENV)/.installed-dev  ## run every benchmark and print its ratios
	@for script in $(filter-out %/bench_base.py,$(wildcard benchmarks/bench_*.py)); do echo "== $$script"; $(BIN)/python "$$script" || exit 1; done

bench-base: $(VENV)/.installed-dev  ## print processor times beside an earlier commit, which goes into .bench-base
	@test -e .bench-base || git worktree add --detach .bench-base 93240e7
	$(BIN)/python benchmarks/bench_base.py

contest: $(VENV)/.installed-dev  ## run the contest of distributed filters, 20 seeds, and show it; it goes on where it was
	$(BIN)/python docs/contest.py run --repeat 20
	$(BIN)/python docs/contest.py show --out runs/contest

contest-small: $(VENV)/.installed-dev  ## the same with 6 seeds
	$(BIN)/python docs/contest.py run --repeat 6
	$(BIN)/python docs/contest.py show --out runs/contest
