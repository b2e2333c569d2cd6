# `make demo` and `make test` need nothing but Python >= 3.11 (with its venv module) and make.
PYTHON ?= python3
VENV ?= .venv
OUT ?=
PYTEST ?=

ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif
RUN := $(BIN)/python
# Twice quiet: errors only. With a mirror pip warns of every place that it passes over.
PIP = $(RUN) -m pip --quiet --quiet
INSTALL = $(PIP) install --constraint constraints.txt --build-constraint constraints.txt
INSTALLED_DEMO := $(VENV)/.installed-demo
INSTALLED := $(VENV)/.installed
INSTALLED_DOCS := $(VENV)/.installed-docs

.PHONY: help demo test test-all check docs picture benchmark clean
.DELETE_ON_ERROR:

help:
	@echo "make demo       build, tune, run on the emulated bench, diagnose, tune again, draw (into results/demo, with a number where it exists, or OUT=DIR)"
	@echo "make test       run the tests, the slow ones left out"
	@echo "make test-all   run every test"
	@echo "make check      ruff, pyright and import-linter"
	@echo "make docs       build the site (build/docs/index.html)"
	@echo "make picture    draw the pictures of the documentation again"
	@echo "make benchmark  print the figures that the documentation quotes"
	@echo "make clean      remove everything that make and bender made in this folder, but for runs on a bench (results/hil-*, and what else in results holds the journal of a run)"

demo: $(INSTALLED_DEMO)
	$(RUN) -m bender_cli demo $(if $(OUT),--out $(OUT))

# Whole files go to a worker, so that what the tests of a file share is made once.
test: $(INSTALLED)
	$(RUN) -m pytest -n 2 --dist loadfile -m "not slow" $(PYTEST)

test-all: export HYPOTHESIS_PROFILE = thorough
test-all: $(INSTALLED)
	$(RUN) -m pytest -n 2 --dist loadfile $(PYTEST)

check: $(INSTALLED)
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m pyright --pythonpath $(RUN)
	$(BIN)/lint-imports

# Warnings are errors: a link that leads nowhere, a page that no table of contents lists, a tutorial that fails.
docs: $(INSTALLED_DOCS)
	$(RUN) -m sphinx -b html -j auto -W --keep-going -n -q docs build/docs

picture: $(INSTALLED)
	$(RUN) -m bender_cli tune --model bench --out results/picture
	$(RUN) -c "import shutil; shutil.copyfile('results/picture/step.png', 'docs/step-response.png')"
	$(RUN) docs/_tools/draw_before_after.py
	$(RUN) docs/_tools/draw_evidence.py

benchmark: $(INSTALLED)
	$(RUN) -m bender_cli benchmark tuner

# A run on a bench cannot be made again: what holds its journal stays, also that of an investigation or of a run with
# --out. The demonstration and the reproduction only use the emulated bench, which their journals say: they go.
JOURNALS := \( -name run.jsonl -o -name guard.jsonl -o -name rescue.jsonl -o -name journal.jsonl \)

clean:
	@for entry in results/* results/.[!.]*; do \
	  [ -e "$$entry" ] || [ -L "$$entry" ] || continue; \
	  case "$$entry" in \
	    results/hil-*) runs=kept ;; \
	    results/demo*|results/reproduce*) \
	      runs=$$(find "$$entry" -type f $(JOURNALS) ! -exec grep -q '"emulated": true' {} \; -print) ;; \
	    *) runs=$$(find "$$entry" -type f $(JOURNALS)) ;; \
	  esac; \
	  if [ -n "$$runs" ]; then echo "kept: $$entry"; else rm -rf "$$entry"; fi; \
	done
	[ ! -d results ] || rmdir results 2>/dev/null || true
	rm -rf $(VENV) build dist docs/api fmu/*.fmu fmu/*.ssp .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The bundled pip may be too old for dependency groups, so the pinned one comes first.
$(INSTALLED_DEMO): pyproject.toml constraints.txt
	@$(PYTHON) -c "import sys; sys.version_info >= (3, 11) or sys.exit('bender needs Python 3.11 or newer, found ' + sys.version.split()[0] + ' at ' + sys.executable + '; say which one to use: make PYTHON=python3.12 ...')"
	@$(PYTHON) -c "import ensurepip, venv" || { echo "This Python cannot make virtual environments; on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@echo "Installing into $(VENV); this happens once and may take a few minutes"
	$(PYTHON) -m venv $(VENV)
	$(PIP) install --constraint constraints.txt --upgrade pip
	$(PIP) uninstall --yes setuptools
	$(INSTALL) --editable ".[bench,pictures]"
	@$(RUN) -c "import pathlib; pathlib.Path('$(INSTALLED_DEMO)').touch()"

$(INSTALLED): $(INSTALLED_DEMO)
	$(INSTALL) --editable ".[bench,cluster,container,formats,identify,live,notebook,pictures]" --group dev
	@$(RUN) -c "import pathlib; pathlib.Path('$(INSTALLED)').touch()"

$(INSTALLED_DOCS): $(INSTALLED)
	$(INSTALL) --group docs
	@$(RUN) -c "import pathlib; pathlib.Path('$(INSTALLED_DOCS)').touch()"
