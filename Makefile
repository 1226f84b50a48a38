# Two commands: `make demo` sets everything up and runs the main job, `make test` sets everything up and tests.
# PYTHON must be 3.11 or 3.12.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
BEFORE ?= ../before
SLOWER ?= 0.3
export ROS_DOMAIN_ID ?= 42
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

# Studies that write a page, those first that take longest; and further arguments of one of them.
PAGES := derivatives accuracy maps fuzz hard paper faults effects digits certificate domain
fuzz_options := --seed 20261130 --draws 60000 --jobs 2

.PHONY: demo test thorough quick lint install docs study laboratory benchmark mutants lowest clean

demo: install
	$(BIN)/grasp run case_01

# The tests of every commit. While one core checks types, the other compiles what both halves of the tests would.
test: install
	$(BIN)/ruff check .
	$(BIN)/mypy & PYTHONPATH=. $(BIN)/python -m grasp_ros.cli simulate case_01 --sensitivity left_arm.mass_kg >/dev/null; wait $$!
	$(BIN)/pytest -n 2 --dist loadfile -m "not thorough" --durations 20

# All tests, before a release and after a change of what only these look at.
thorough: lint
	$(BIN)/pytest -n 2 --dist loadfile --durations 20

# What takes seconds.
quick: lint
	$(BIN)/pytest -n 2 --dist loadfile -m "not slow"

lint: install
	$(BIN)/ruff check .
	$(BIN)/mypy

install: $(VENV)/ready
	rm -rf build
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --force-reinstall .

# The documentation as a site, in `site`; any warning is an error.
docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# Every page that the laboratory writes, but for one table (CONTRIBUTING.md), some hours on a quiet machine; one page
# with, say, `make study-paper`.
study: $(PAGES:%=study-%)
.NOTPARALLEL:

study-%: laboratory
	$(BIN)/python -m lab $* --docs docs $($*_options)

# Its peers are large and only wanted here.
laboratory: install
	$(BIN)/pip install --quiet -c constraints.txt ".[lab]"

# Times of this checkout beside those of another one, which fail where one is longer by more than SLOWER.
benchmark: install
	$(BIN)/python lab/benchmarks/compare.py $(BEFORE) . --slower $(SLOWER)

# Changes branches, comparisons, operations and numbers of the automaton in turn; a test should fail for each.
mutants: install
	$(BIN)/python test/exact/mutants.py

# The quick tests with the lowest versions that the bounds of pyproject.toml admit.
lowest:
	$(PYTHON) -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/pip install --quiet uv
	$(VENV)-lowest/bin/uv pip install --quiet --python $(VENV)-lowest/bin/python --resolution lowest-direct ".[test]"
	$(VENV)-lowest/bin/pytest -n 2 --dist loadfile -m "not slow"

$(VENV)/ready: pyproject.toml setup.py constraints.txt
	$(PYTHON) -c "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12) and 'Python 3.11 or 3.12 is needed')"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet -c constraints.txt setuptools wheel ".[test]"
	touch $@

clean:
	rm -rf build install log site *.egg-info .*_cache .hypothesis $(VENV) $(VENV)-lowest
