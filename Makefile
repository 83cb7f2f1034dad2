# Every job is one command; `make help` lists them. Two of them do all set-up themselves: sitl, test.
SHELL := /bin/bash
VENV := .venv
PIP := $(VENV)/bin/pip --disable-pip-version-check
BIN := $(VENV)/bin
NATIVE := CMakeLists.txt $(wildcard runtime/native/*.?pp hil_sim/native/*.?pp)
# One BLAS thread: the two cores are for the vessels, and results do not depend on their number.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

# One process a core; a file stays with one, so that what its tests share is made once.
JOBS ?= $(shell nproc)
PYTEST = $(BIN)/pytest -n $(JOBS) --dist loadfile
# What failed beside others is tried once more, alone: it may have lacked processor.
ALONE = $(BIN)/pytest --last-failed --last-failed-no-failures none

.PHONY: help setup setup-dev sitl test test-fast test-nightly check format lint types imports bench train \
        fuzz wheel docs clean native determinism accept audit faults soak
.DEFAULT_GOAL := help

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*  ## ' $(MAKEFILE_LIST) | sed -E 's/:.*  ## /\t/' | expand -t 14

setup: $(VENV)/.built  ## install twinscrew for simulation (no torch) into .venv

setup-dev: $(VENV)/.installed-dev $(VENV)/.built  ## install everything, torch and the checkers too

sitl: setup  ## sail 3 vessels across the paper's map, in wind and waves, in real time
	$(BIN)/twinscrew sitl --vessels 3 $(SITL_ARGS)

test: setup-dev $(VENV)/.browser  ## run the test suite; those in real time last, alone
	$(PYTEST) -m "not realtime and not nightly" || $(ALONE) -m "not realtime and not nightly"
	$(BIN)/pytest tests/integration -m "realtime and not nightly"

test-fast: setup-dev  ## run the tests that take less than a second each
	$(PYTEST) -m "not slow and not realtime and not nightly"

test-nightly: setup-dev $(VENV)/.browser  ## run everything, with new examples, and check the tiers
	HYPOTHESIS_PROFILE=wide $(PYTEST) -m "not realtime" --tiers --timeout 3000
	$(BIN)/pytest tests/integration -m realtime --timeout 3000

check: format lint types imports docs test  ## everything that keeps us honest: format to tests

format: setup-dev  ## check the formatting
	$(BIN)/ruff format --check .

lint: setup-dev  ## check the style
	$(BIN)/ruff check .

types: setup-dev  ## check the types (mypy --strict)
	$(BIN)/mypy

imports: setup-dev  ## check that imports point one way
	$(BIN)/lint-imports

determinism: setup-dev  ## prove that the same recording gives the same bits, and the accepted ones
	$(BIN)/python -m tests.replay.accept --check
	$(BIN)/pytest tests/replay

accept: setup-dev  ## show how decisions differ from the accepted ones, and renew these if you agree
	$(BIN)/python -m tests.replay.accept

faults: setup  ## make every fault on real processes, and hold the boat to its promises
	$(BIN)/twinscrew faults $(FAULTS_ARGS)

soak: setup  ## sail SOAK_MIN minutes (default 60) with faults at random; look for what grows
	$(BIN)/twinscrew soak --minutes $(or $(SOAK_MIN),60) $(SOAK_ARGS)

bench: setup-dev  ## measure everything and print the figures
	$(BIN)/twinscrew bench

train: setup-dev  ## train the shipped policy's configuration, one seed
	$(BIN)/twinscrew train config/training/ac_iqn.toml --seeds 0

native: $(VENV)/.installed-dev  ## rebuild the native modules after a change in C++
	$(REBUILD)
	@touch $(VENV)/.built

fuzz: setup-dev  ## fuzz decoder, kernels and messages, FUZZ_S seconds each of six (default 120)
	bash tests/fuzz/run.sh $(or $(FUZZ_S),120)

wheel: setup-dev  ## build the boat's wheel (runtime alone) and try it in a bare environment
	bash deploy/wheel.sh

audit: setup-dev  ## look for known vulnerabilities, and for licences that a boat cannot carry
	$(BIN)/python deploy/audit.py

docs: setup-dev  ## build the documentation site into build/docs/site; no link may be broken
	$(BIN)/python docs/site/stage.py
	$(BIN)/zensical build --strict

clean:  ## remove the environment, builds and runs
	rm -rf $(VENV) build dist runs

# -- set-up ---------------------------------------------------------------------------------------

$(VENV)/bin/python:
	bash deploy/bootstrap.sh $(VENV)

# One build at a time. With the build's tools installed it has a folder of its own: an isolated build
# finds its tools at another path each time, and so compiles everything anew, nanobind too.
INSTALL := flock .build.lock $(PIP) install -q -c constraints.txt
REBUILD = $(if $(wildcard $(VENV)/.installed-dev),SKBUILD_BUILD_DIR=build/native \
	$(INSTALL) --no-build-isolation,$(INSTALL)) --no-deps -e .

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(INSTALL) -e ".[sim]"
	@touch $@ $(VENV)/.built

$(VENV)/.browser: $(VENV)/bin/python
	bash deploy/browser.sh
	@touch $@

$(VENV)/.installed-dev: $(VENV)/bin/python pyproject.toml constraints.txt
	$(INSTALL) -e ".[sim,chart,judge,train,dev,docs]" \
		$$($(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"])') \
		cmake ninja
	@touch $@ $(VENV)/.installed $(VENV)/.built

$(VENV)/.built: $(NATIVE) | $(VENV)/.installed
	@test -e $@ && test -z "$$(find $(NATIVE) -newer $@)" || ($(REBUILD))
	@touch $@
