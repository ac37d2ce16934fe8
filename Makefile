# The two commands of the README are `run` and `test`; every target sets up what it needs.

# The first of these versions that is there and can make environments; of several of it the one that
# computes fastest: how a Python was built makes a fifth of whatever is done with it.
SPEED = import sys, venv, ensurepip, timeit; \
	(3, 11) <= sys.version_info < (3, 14) or sys.exit(1); \
	print(min(timeit.repeat("[str(f(n)) for n in range(9999)]", "f = lambda n: n + 1", number=3)), sys.executable)
ifndef PYTHON
PYTHON = $(eval PYTHON := $(shell for name in python3.11 python3.12 python3.13 python3; do \
	found=$$(for each in $$(type -ap $$name); do $$each -c '$(SPEED)' 2>/dev/null; done | sort -g | head -n 1 | cut -d' ' -f2-); \
	if [ -n "$$found" ]; then echo "$$found"; break; fi; done))$(PYTHON)
endif
# A half of the tests that fails must fail although its output goes through a pipe.
SHELL := bash
.SHELLFLAGS := -o pipefail -c
BIN := .venv/bin
export TOUCHLINE_HOME ?= $(CURDIR)/.touchline
# Compiled modules are kept: without them every process of a test compiles all anew.
unexport PYTHONDONTWRITEBYTECODE
NPM := PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm

.PHONY: setup run test test-all test-python test-browser test-late test-postgresql check audit release generators readers moto bench mutate torture fuzz paper chromium postgresql caddy clean
.DEFAULT_GOAL := run

setup: .venv/ready static/node_modules/.ready static/built/about.json

.venv/ready: requirements.lock pyproject.toml
	@test -n "$(PYTHON)" || { echo "Touchline needs Python 3.11, 3.12 or 3.13 with venv (Debian: apt-get install python3-venv)."; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || { echo "$(PYTHON) is another Python than 3.11, 3.12 or 3.13, for which the libraries are pinned."; exit 1; }
	@echo "Installing Python packages into .venv"
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

static/node_modules/.ready: static/package-lock.json .venv/ready
	@echo "Installing browser libraries into static/node_modules"
	@cd static && PATH="$(CURDIR)/$(BIN):$$PATH" npm ci --no-audit --no-fund --loglevel=error
	@touch $@

# The modules in a few files. Where they cannot be joined, pages ask for the modules themselves.
MODULES = $(shell find static \( -name node_modules -o -name built -o -name built.new \) -prune -o -name '*.js' -print)
static/built/about.json: static/build.mjs static/node_modules/.ready $(MODULES)
	@PATH="$(CURDIR)/$(BIN):$$PATH" npm --prefix static run --silent build || echo "The modules could not be joined; pages will ask for each of them."

run: setup
	@$(BIN)/touchline serve --sample

# Two halves side by side, in as many processes as there are cores, and two more for the half that waits
# for processes of its own: servers and browsers that are tested are processes too. Files in their order,
# so that the long ones (integration, security) come first and no process is left with one at the end.
# Every line says which half speaks.
PROCESSES = $(shell n=$$(getconf _NPROCESSORS_ONLN); echo $$(( n < 2 ? 2 : n < 8 ? n : 8 )))
# A process that ends is replaced once: its tests would be tried again and again.
# What tests write lies in memory where that has much room: they wait for no disk.
ROOMY = $(shell df -Pk /dev/shm 2>/dev/null | awk 'NR == 2 && $$4 > 8000000 { print "yes" }')
PYTEST = $(if $(ROOMY),PYTEST_DEBUG_TEMPROOT=/dev/shm) $(BIN)/python -m pytest --dist=loadfile --no-loadscope-reorder --max-worker-restart=1

# What proves the product on one machine. What numba compiles is compiled before: every process would do
# it anew, until one has saved it.
test: QUICK = --quick
test: setup chromium postgresql readers moto
	@$(BIN)/python -m tests.compiled
	@$(MAKE) --no-print-directory -j2 QUICK=$(QUICK) test-python test-browser
	@echo "Every test has passed."

# The same and what is slow and broad (tests/broad.txt): torture in its short form, every upgrade, wheels, generated
# clients, a cluster, the twins on PostgreSQL, hostile requests to every operation; and late pages. For every night.
test-all: setup chromium postgresql caddy generators readers moto
	@$(BIN)/python -m tests.compiled
	@$(MAKE) --no-print-directory -j2 test-python test-browser
	@$(MAKE) --no-print-directory test-late
	@echo "Every test has passed."

test-python:
	@$(PYTEST) --numprocesses=$$(( $(PROCESSES) + 2 )) $(QUICK) --ignore=tests/e2e 2>&1 | sed -u 's/^/python  | /'

test-browser:
	@{ $(BIN)/npm --prefix static test && $(PYTEST) --numprocesses=$(PROCESSES) $(QUICK) tests/e2e; } 2>&1 | sed -u 's/^/browser | /'

# The browser tests before pages whose every request, frame, picture and event is late: who does not wait falls.
test-late: setup chromium
	@TOUCHLINE_SLOW_PAGES=$(or $(MS),300) $(PYTEST) --numprocesses=$(PROCESSES) tests/e2e

# All tests but those of the browser with every home on a private PostgreSQL: WHAT=tests/unit/db a part, WHAT=tests/e2e those of
# the browser. What is about the file of SQLite is left out; each says why.
test-postgresql: setup postgresql generators readers moto
	@$(BIN)/python -m tests.compiled
	@$(BIN)/python -m tests.on_postgresql --numprocesses=$(PROCESSES) --dist=loadfile --no-loadscope-reorder -rs $(or $(WHAT),tests --ignore=tests/e2e)

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/npm --prefix static run check
	$(BIN)/python -m tests.release licences
	@$(MAKE) --no-print-directory audit

# Programs that only a release needs, apart: they would double what everybody installs.
.venv-release/ready: requirements-release.lock .venv/ready
	@echo "Installing the programs of a release into .venv-release"
	@test -x .venv-release/bin/python || $(PYTHON) -m venv .venv-release
	@.venv-release/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-release.lock
	@touch $@

# Published weaknesses. Who has no network, or whose registry does not answer, is told so, and is not wrong.
audit: setup
	@$(MAKE) --no-print-directory .venv-release/ready || echo "The programs that ask could not be installed."
	@$(BIN)/python -m tests.release advisories .venv-release/bin

release: setup .venv-release/ready
	@$(BIN)/python -m tests.release build dist .venv-release/bin

# Programs that make clients of the OpenAPI document, for a test; apart, for one needs an older typer
# than the product, the other an older TypeScript.
generators: .venv-generators/ready tests/generators/node_modules/.ready

.venv-generators/ready: requirements-generators.lock .venv/ready
	@echo "Installing openapi-python-client into .venv-generators"
	@test -x .venv-generators/bin/python || $(PYTHON) -m venv .venv-generators
	@.venv-generators/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-generators.lock
	@touch $@

tests/generators/node_modules/.ready: tests/generators/package-lock.json .venv/ready
	@echo "Installing openapi-typescript into tests/generators/node_modules"
	@cd tests/generators && PATH="$(CURDIR)/$(BIN):$$PATH" npm ci --no-audit --no-fund --loglevel=error
	@touch $@

# The packages with which users read exports, for a test; apart, for the product needs none of them.
readers: .readers/ready

.readers/ready: requirements-readers.lock .venv/ready
	@echo "Installing soccernet, sn-trackeval, pycocotools, datasets, kloppy and the CDF validator into .readers"
	@rm -rf .readers
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps --target .readers -r requirements-readers.lock
	@touch $@

# The S3 server that tests ask; apart, for its client wants an older python-dateutil than the product's libraries.
moto: .moto/ready

.moto/ready: requirements-moto.lock .venv/ready
	@echo "Installing moto into .moto"
	@rm -rf .moto
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps --target .moto -r requirements-moto.lock
	@touch $@

bench: setup
	$(BIN)/python -m tests.bench

mutate: setup
	$(BIN)/python -m tests.mutate

torture: setup caddy
	$(BIN)/python -m tests.torture

# Files of every format, damaged at random: ten minutes, or SECONDS=60.
fuzz: setup
	$(BIN)/python -m tests.fuzz --seconds $(or $(SECONDS),600)

paper: setup
	$(BIN)/python -m tests.paper

chromium: setup
	@$(BIN)/python tests/e2e/install_chromium.py

postgresql: setup
	@$(BIN)/python -m tests.install_postgresql

# The proxy of a team, behind which the flood runs.
caddy: setup
	@$(BIN)/python -m tests.torture.proxy

clean:
	rm -rf .venv .venv-release .venv-generators .readers .moto dist static/node_modules static/built tests/generators/node_modules
