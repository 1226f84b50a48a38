# Two commands: `make demo` sets everything up and runs the main job, `make test` sets everything up and tests.
# PYTHON must be 3.11 or 3.12.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
SLOWER ?= 30%
export ROS_DOMAIN_ID ?= 42
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

.PHONY: demo test lint install study benchmark mutants clean

demo: install
	$(BIN)/grasp run case_01

# All tests, some minutes, those that judge by wall time alone; `pytest -m "not slow"` runs those that take seconds.
test: lint
	$(BIN)/pytest -n 2 --dist loadfile -m "not alone"
	$(BIN)/pytest -m alone

lint: install
	$(BIN)/ruff check .
	$(BIN)/mypy

install: $(VENV)/ready
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --force-reinstall .

# The peers of the benchmarks are large and only wanted here.
study: install
	$(BIN)/pip install --quiet -c constraints.txt ".[study]"
	$(BIN)/grasp study page
	$(BIN)/grasp study paper --docs docs/paper.md
	$(BIN)/grasp study speed case_01
	$(BIN)/grasp study graph case_01

# Saves a result in runs/benchmarks, and fails if the fastest run of a benchmark is slower than in the last one there.
benchmark: install
	$(BIN)/pip install --quiet -c constraints.txt ".[study]"
	$(BIN)/pytest benchmarks -W default --benchmark-storage=runs/benchmarks --benchmark-autosave \
	    --benchmark-columns=min,median,rounds \
	    $(if $(wildcard runs/benchmarks/*/*.json),--benchmark-compare --benchmark-compare-fail=min:$(SLOWER))

# Deletes or negates every branch of the automaton and of `rest` in turn; a test must fail for each.
mutants: install
	$(BIN)/python test/exact/mutants.py

$(VENV)/ready: setup.py constraints.txt
	$(PYTHON) -c "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12) and 'Python 3.11 or 3.12 is needed')"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet -c constraints.txt setuptools wheel ".[test]"
	touch $@

clean:
	rm -rf build install log *.egg-info $(VENV)
