# Everything there is to do with a clone. `make` alone lists it.
# Needs Python 3.11 or later as python3 (or PYTHON=...) and a C compiler; no database and no broker.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Stamps: the set-up is redone when what it was made from changes, and only then.
READY := $(VENV)/.ready
READY_TO_DEVELOP := $(VENV)/.ready-to-develop

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup demo test test-faults reliability bench bench-solve docs lint format lock clean studies

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(READY) ## make .venv with everything the service needs, locked by hash; gives .venv/bin/armature

demo: $(READY) ## the paper's application, end to end: 25 tasks, one design, compared with two others (a few minutes)
	$(BIN)/armature run examples/pick_and_place.yaml

test: lint ## lint, types, layers, then all tests
	$(BIN)/pytest -n 2 --dist worksteal

test-faults: $(READY_TO_DEVELOP) ## kill and freeze everything as often as docs/reliability.md says (some twenty minutes)
	$(BIN)/pytest tests/faults --full-faults -n 2 --dist worksteal  # most of them wait most of the time

reliability: test-faults ## the same, and write what was measured into docs/reliability.md
	$(BIN)/python -m benchmarks.reliability

bench-solve: $(READY_TO_DEVELOP) ## the part of it by pytest-benchmark: the paper's formulation beside ours, and a solve's parts
	@mkdir -p .benchmarks
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -o addopts= --timeout 0 benchmarks --benchmark-timer time.process_time \
		--benchmark-json .benchmarks/solve.json

bench: bench-solve ## measure, and write the tables of docs/performance.md (half an hour)
	@for part in solve_time baseline_optima growth random_tasks "random_tasks --kind energy" infeasible_tasks fan_out job_parts start_up memory throughput dashboard; do \
		echo "--- $$part"; OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.$$part || exit 1; done

studies: $(READY_TO_DEVELOP) ## figures and tables of docs/shared_optimum.md, from the stored results
	$(BIN)/python docs/make_studies.py

docs: $(READY_TO_DEVELOP) ## the documentation site, into out/site; a broken link or anchor ends it
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet

lint: $(READY_TO_DEVELOP) ## ruff, mypy, import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY_TO_DEVELOP) ## format the code, and fix what ruff can fix
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

UV_COMPILE = uv pip compile --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
	--python-version 3.11 pyproject.toml

lock: ## write the lock files from pyproject.toml, with hashes (needs uv; UPGRADE=--upgrade takes the newest versions)
	$(UV_COMPILE) $(UPGRADE) --group build -o requirements.lock
	$(UV_COMPILE) $(UPGRADE) --extra tables --group build -o requirements-tables.lock
	$(UV_COMPILE) $(UPGRADE) --extra tables --group dev -o requirements-dev.lock

clean: ## remove .venv, caches and results
	rm -rf $(VENV) out build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or later is needed; 'make PYTHON=/path/to/python3 ...' names another"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(READY): pyproject.toml requirements-tables.lock | $(VENV)/pyvenv.cfg
	$(BIN)/pip install --quiet --require-hashes -r requirements-tables.lock
	$(BIN)/pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(READY_TO_DEVELOP): $(READY) requirements-dev.lock
	$(BIN)/pip install --quiet --require-hashes -r requirements-dev.lock
	@touch $@
