# From a bare clone: `make run` or `make test`. All that is needed is GNU make and
# Python >= 3.11 with venv and pip; another one with `make run PYTHON=python3.12`.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2
DEMO := runs/walk
STUDIES ?= $(notdir $(wildcard docs/studies/*))

# One thread for each process: the arrays are small, and results must not depend
# on the number of cores.
export OMP_NUM_THREADS := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
.PHONY: help setup run test test-slow format lock docs performance pictures studies clean
.PHONY: check check-format check-lint check-types check-imports

help:
	@echo "make run          the demo: walk on the ball, with its log"
	@echo "make test         the fast test suite"
	@echo "make test-slow    the slow tests"
	@echo "make check        formatting, lint, types, imports between modules"
	@echo "make format       put the sources into their standard form"
	@echo "make performance  measure the speed anew: docs/performance.md (6 minutes)"
	@echo "make docs         build the documentation site: build/site/index.html"
	@echo "make pictures     take the pictures of docs/images anew (2 minutes)"
	@echo "make studies      run the studies of docs/studies anew (hours; STUDIES=NAME for one)"
	@echo "make lock         pin the newest packages in requirements.lock"
	@echo "make clean        remove $(VENV) and all caches; runs are kept"

setup: $(VENV)/.installed

# Two steps, so that an edit of pyproject.toml does not build $(VENV) anew.
$(VENV)/.locked: requirements.lock
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "ballsim needs Python >= 3.11")'
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements.lock
	@touch $@

$(VENV)/.installed: $(VENV)/.locked pyproject.toml
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

run: setup
	$(BIN)/ballsim run walk --out $(DEMO)
	@echo
	@echo "summary     $(DEMO)/summary.json"
	@echo "all files   $(DEMO)"
	@echo "watch it    $(BIN)/ballsim view $(DEMO)"
	@echo "repeat it   $(BIN)/ballsim replay $(DEMO)"
	@echo "more        $(BIN)/ballsim --help, and README.md"

# Doctests of both packages and the notebooks are part of both suites.
test: setup
	$(BIN)/python -m pytest --numprocesses $(WORKERS) -m "not slow"

test-slow: setup
	$(BIN)/python -m pytest --numprocesses $(WORKERS) -m slow

# Each on its own, so that `make --keep-going check` tells all complaints.
check: check-format check-lint check-types check-imports

check-format: setup
	$(BIN)/ruff format --check .

check-lint: setup
	$(BIN)/ruff check .

check-types: setup
	$(BIN)/mypy

check-imports: setup
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Hashes of every file of a release, as the package index gives them: pip's own
# configuration, which may know local copies, is left out.
lock: setup
	env -u PIP_FIND_LINKS PIP_CONFIG_FILE=/dev/null CUSTOM_COMPILE_COMMAND="make lock" \
		$(BIN)/pip-compile --quiet --upgrade --generate-hashes --allow-unsafe \
		--strip-extras --extra cluster --extra dev --extra video --no-emit-options --no-annotate \
		--output-file requirements.lock pyproject.toml

# Into another file first: a failure leaves the old figures.
performance: setup
	$(BIN)/ballsim bench --repeats 9 --batch --memory --json > docs/performance.json.new
	mv docs/performance.json.new docs/performance.json
	$(BIN)/python -m ballsim.bench.table docs/performance.json docs/performance.md

# Warnings are errors; a test builds the site, too.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# Needs a Vulkan driver and EGL, such as those of Debian's mesa-vulkan-drivers and
# libegl1, and no display.
pictures: setup
	$(BIN)/ballsim run walk --out runs/docs/walk --json > /dev/null
	$(BIN)/python -m ballsim.recording.screenshots runs/docs/walk docs/images
	$(BIN)/python -m ballsim.recording.film_frame runs/docs/walk docs/images/robot_on_ball.png
	$(BIN)/ballsim plot runs/docs/walk --out runs/docs/figures
	cp runs/docs/figures/figures.png docs/images/figures.png
	$(BIN)/ballsim run walk --ball-radius 0.25 --out runs/docs/small --json > /dev/null
	$(BIN)/ballsim compare runs/docs/walk runs/docs/small --out runs/docs/figures
	cp runs/docs/figures/comparison.png docs/images/comparison.png
	$(BIN)/ballsim run push --ball-radius 0.5 --set force=120 --set direction=1.5708 \
		--no-log --out runs/docs/push --json > /dev/null
	$(BIN)/python -m ballsim.recording.film_frame runs/docs/push docs/images/push.png \
		--moment 3 3.3 3.6 3.9 4.2 4.5 5.5
	$(BIN)/python -m ballsim.task_page docs/images/tasks.png --workers $(WORKERS)

# One that was broken off goes on; one that is done is removed, so that the next call runs
# it with the code of then. Others: `make studies STUDIES=envelope`.
studies: setup
	set -e; for name in $(STUDIES); do \
		done=runs/docs/$$name; kept=docs/studies/$$name; \
		$(BIN)/ballsim study studies/$$name.toml --out $$done --workers $(WORKERS) $(OPTIONS); \
		rm -rf $$kept; mkdir -p $$kept; \
		cp $$done/results.parquet $$done/report.* $$done/*.png $$kept; \
		rm -r $$done; \
	done

clean:
	rm -rf $(VENV) build dist .*_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
