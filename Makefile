# Everything a newcomer types. PYTHON: the interpreter that .venv is made with. ARGS: passed on to the command.
# STUDY: a file in sweeps/. JOBS: tests at once, of one thread each.
NEW_ENOUGH := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for p in python3.11 python3 python; do "$$p" $(NEW_ENOUGH) 2>/dev/null && command -v "$$p" && break; done)
VENV ?= .venv
TORCH ?= torch==2.13.0
ARGS ?=
STUDY ?= smoke
JOBS ?= 2

RUN := "$(VENV)/bin/python"
STAMP := $(VENV)/.complete

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup peers demo test fuzz power-cuts load test-slurm lint train sweep results tables figures report report-html abc bench docs lock clean

help: ## List these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' Makefile

setup: $(STAMP) ## Make .venv and install the pinned versions (nothing to do when up to date)

# Every package by the hash of its file. torch, whose build is the user's choice (TORCH=...), brings what its build needs.
$(STAMP): pyproject.toml requirements.lock
	@"$(PYTHON)" $(NEW_ENOUGH) 2>/dev/null \
		|| { echo "No Python 3.11 or newer found$(if $(PYTHON), at $(PYTHON)): name one, make setup PYTHON=..."; exit 2; }
	@$(RUN) -m pip --version >/dev/null 2>&1 || "$(PYTHON)" -m venv "$(VENV)"
	$(RUN) -m pip install --quiet --no-deps --require-hashes -r requirements.lock
	$(RUN) -m pip install --quiet "$(TORCH)"
	$(RUN) -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch "$@"

peers: setup ## The libraries of `python -m benchmarks peers` into .venv (Linux, macOS; 500 MB)
	$(RUN) -m pip install --quiet --no-deps --require-hashes -r requirements-peers.lock

demo: setup ## Fit, extract and measure the built-in part part_01, and say where to look
	$(RUN) train.py $(ARGS)
	@echo "Look under outputs/ (preview.png, mesh.ply, result.json), or: $(VENV)/bin/tensorboard --logdir outputs"

train: setup ## One run or a sweep, e.g. make train ARGS="head=relu shape=part_02"
	$(RUN) train.py $(ARGS)

sweep: setup ## A whole study, STUDY=main: finished runs are skipped, partial ones go on; ARGS="head=siren" narrows it
	$(RUN) train.py sweeps=$(STUDY) $(ARGS)

results: setup ## The rows of STUDY into results/<study>/runs.csv, to be committed: no clone runs them again
	$(RUN) -m jointsdf.study results $(STUDY) $(ARGS)

tables: setup ## Tables (.csv and .tex) of the studies below outputs/, in outputs/tables/<study>/; ARGS=--all: the committed ones too
	$(RUN) -m jointsdf.study tables $(ARGS)

figures: setup ## Figures (.pdf and .png) of the studies below outputs/, in outputs/figures/<study>/; ARGS=--all as above
	$(RUN) -m jointsdf.figures $(ARGS)

report: figures ## All tables and figures in one document, outputs/tables/report.pdf (needs LaTeX)
	$(RUN) -m jointsdf.study report $(ARGS)

report-html: setup ## Page of STUDY=main for a browser, outputs/pages/<study>/index.html; 3D where the run folders are
	$(RUN) -m jointsdf.study.page --study $(STUDY) $(ARGS)

abc: setup ## The catalogue's ABC shapes into data/abc, from a download or ARGS="--from DIR"; ARGS=--help tells more
	$(RUN) -m jointsdf.shapes.abc prepare $(ARGS)

bench: setup ## Ratios of step, fit, extraction, overhead and time to quality, in about 25 minutes; ARGS=--write keeps them
	$(RUN) -m benchmarks $(ARGS)

test: setup ## The whole test suite, slow tests included; ARGS="-m 'not slow'" leaves those out
	$(RUN) -m pytest -n $(JOBS) $(ARGS)

fuzz: setup ## 2,000 damaged files of each format: each loads, or is refused in one line; in about 40 minutes
	JOINTSDF_FUZZ=2000 $(RUN) -m pytest -n $(JOBS) tests/shapes/test_fuzz.py $(ARGS)

power-cuts: setup ## A run cut off at 50 of its flushes to the disk, its names kept and lost, goes on to the same bits; ten minutes
	JOINTSDF_POWER_CUTS=50 $(RUN) -m pytest -n $(JOBS) tests/trust/test_power_cut.py $(ARGS)

load: setup ## Six processes on one sweep, 40 kills, then meshes of 2 million faces, 10,000 rows, 10^7 points: half an hour
	JOINTSDF_LOAD=40 $(RUN) -m pytest tests/trust/test_load_runs.py tests/trust/test_load_fields.py $(ARGS)
	$(RUN) -m benchmarks.load

test-slurm: setup ## The test of hydra/launcher=slurm, on a SLURM that it starts here; needs root and apt install slurm-wlm munge
	JOINTSDF_TEST_SLURM=1 $(RUN) -m pytest tests/experiment/test_sweep_engines.py -k slurm $(ARGS)

lint: setup ## ruff, mypy and the import contracts
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	"$(VENV)/bin/lint-imports"

docs: setup ## The documentation into docs/_build/html, offline; executes its notebook, and a warning is an error
	$(RUN) docs/package_graph.py
	$(RUN) -m sphinx -b html -W --keep-going -q docs docs/_build/html
	@grep -q '<img[^>]*png' docs/_build/html/notebooks/first_fit.html || { echo "the notebook's page has no figure"; exit 1; }
	@echo "Open docs/_build/html/index.html"

COMPILE := uv pip compile pyproject.toml --quiet --universal --python-version 3.11.5 --generate-hashes --no-annotate --no-header
# Entries of the last file that neither belong to torch nor are in the files before it.
NEW_ENTRIES := awk '/^[a-z]/ {kept = !($$1 in seen) && !/^(torch==|triton|nvidia-|cuda-)/; seen[$$1]} FILENAME == ARGV[ARGC - 1] && kept'

lock: setup ## Both lock files and docs/licences.md anew from pyproject.toml; needs uv. Versions stay where they still fit
	$(COMPILE) --extra dev --extra slurm -o requirements.lock
	$(NEW_ENTRIES) requirements.lock > requirements.lock.new
	mv requirements.lock.new requirements.lock
	$(COMPILE) --extra peers -c requirements.lock -o requirements-peers.lock
	$(NEW_ENTRIES) requirements.lock requirements-peers.lock > requirements-peers.lock.new
	mv requirements-peers.lock.new requirements-peers.lock
	$(RUN) docs/licences.py

clean: ## Delete caches and build leftovers; outputs and .venv stay
	rm -rf build dist docs/_build jointsdf.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find . -path "./$(VENV)" -prune -o -type d -name __pycache__ -exec rm -rf {} +
