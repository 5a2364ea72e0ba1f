# Everything runs in .venv, which is made here; nothing outside the checkout is touched.

PYTHON ?= python3
BIN := .venv/bin
# Python compiles what is imported; --no-compile leaves out the rest, a third of the time to install.
# It must keep what it compiled, or each of the hundreds of processes of the tests compiles it again.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile --constraint constraints.txt

.PHONY: demo test test-all torture check gp docs docs-serve format bench package fuzz audit clean

demo: .venv/.run  ## replay a language model's proposals, then design an arm with real motors and drive it in MuJoCo
	$(BIN)/armwright optimize target-1 --proposer replay:target-1-plus-seed0 --out runs/demo-model
	$(BIN)/armwright design examples/2-assembly-task.yaml --space examples/2-assembly-space.yaml --out runs/demo-arm
	$(BIN)/armwright pick runs/demo-arm --holds --by cycle_time
	$(BIN)/armwright simulate runs/demo-arm

test: .venv/.test  ## the fast tests: three minutes on two cores, without browser and other processes
	$(BIN)/python -m pytest -m "not slow"

test-all: .venv/.test package docs  ## what `make test` leaves out: browser, kills, fuzz, documentation, packages
	$(BIN)/python -m pytest -m slow

torture: .venv/.test  ## faults by the hundred, among them 200 kills; some ten minutes on two cores (docs/reliability.md)
	$(BIN)/python -m pytest tests/torture --kills 200 --dist load --maxschedchunk 1

check: .venv/.test .venv/.check  ## format, lint, types, import staircase
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

gp: .venv/.gp  ## what the sampler gp needs: torch, which is large; its tests are skipped without it

docs: .venv/.docs  ## the user guide, in site/index.html; needs no server and no network
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build

docs-serve: .venv/.docs  ## the same on 127.0.0.1:8000, made anew when a page changes
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs serve

format: .venv/.check
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: .venv/.test  ## the main figures of docs/benchmarks.md; some 25 minutes on two cores
	$(BIN)/python benchmarks/bench.py

package: .venv/.test .venv/.package  ## sdist and wheel in dist/, tried in bare environments of PYTHON
	$(BIN)/python tools/package.py $(PYTHON)

fuzz: .venv/.test  ## 700,000 made-up inputs (docs/security.md)
	$(BIN)/python -m pytest tests/fuzz --fuzz 1

# What cannot be looked up is an error (--strict), not a package without known faults.
audit: .venv/.audit  ## known faults of all that may be installed, extras included; asks PyPI
	$(BIN)/pip-audit --strict --no-deps --disable-pip --requirement constraints.txt

.venv/.python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "armwright needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V 2>&1). Try: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
		{ echo "$(PYTHON) cannot make virtual environments. On Debian and Ubuntu: sudo apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(PIP) pip
	@touch $@

.venv/.run: .venv/.python pyproject.toml constraints.txt
	$(PIP) --editable '.[figures,studies]'
	@touch $@

.venv/.test: .venv/.run
	$(PIP) --editable '.[figures,edit,llm,studies]' --group test
	@touch $@

.venv/.check: .venv/.run
	$(PIP) --group check
	@touch $@

.venv/.docs: .venv/.run
	$(PIP) --group docs
	@touch $@

.venv/.audit: .venv/.python pyproject.toml constraints.txt
	$(PIP) --group audit
	@touch $@

.venv/.gp: .venv/.run
	$(PIP) --editable '.[figures,gp,studies]'
	@touch $@

.venv/.package: .venv/.python
	$(PIP) --group package
	@touch $@

clean:
	rm -rf .venv build dist site fuzz-found .pytest_cache .ruff_cache
