# `make` without a target lists the targets. Everything runs in .venv; if it is missing, it is created from requirements.lock.
# Targets that compare with other codes add the packages of verification/requirements.lock to it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin/python
STAMP := $(VENV)/.installed
ALL := $(VENV)/.verification
CRATE := build/crate/.installed
SITE := build/docs/.installed
OLDEST := build/oldest/.installed
NETWORK := build/network/.installed
GOLD := build/gold/.installed
OLDEST_TESTS := tests/test_python_calls.py tests/test_drawing.py tests/test_field_files.py tests/test_linear.py \
	tests/test_scene.py tests/test_progress.py tests/test_folder.py
PIP := $(BIN) -m pip install -q --disable-pip-version-check

export MPLBACKEND := Agg
# Slow cases and long runs may take longer than a test that hangs (pyproject.toml).
SLOW := -o faulthandler_timeout=3600
# The linear algebra is sparse: threads in the dense kernels only slow it down.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Tests, cases and mutants start hundreds of processes. Python keeps the compiled modules for the next one.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help env figures check-manifest claims sensitivity validation verify verify-fast mutants mutants-sampled test test-thorough oldest lint bench crate network gold docs clean

help:
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' Makefile | awk -F'|' '{ printf "  make %-16s %s\n", $$1, $$2 }'

env: $(STAMP) ## create .venv (0.5 GB) and install this package, figures and pytest in it (PYTHON=python3.12 ...)

figures: $(STAMP) ## run the paper's simulations and draw its figures into paper_figures/out
	@$(BIN) -m paper_figures

check-manifest: $(STAMP) ## compare the data behind the figures with the committed manifest
	@$(BIN) -m paper_figures.manifest

claims: $(STAMP) ## judge the paper's claims by computed numbers, and write the note and the register
	@$(BIN) -m verification.claims
	@$(BIN) -m paper_figures.replication

sensitivity: $(STAMP) ## effects of the rounding of Table 1: elasticities, one set of inputs; continues an interrupted study
	@$(BIN) -m verification.sensitivity

validation: $(STAMP) ## compare the model with measurements, and write the tables of docs/validation.md
	@$(BIN) -m verification.validation

verify: $(ALL) ## run the verification cases against independent references, and write their pages
	@$(BIN) -m pytest verification -n logical --dist worksteal --pages $(SLOW)

verify-fast: $(ALL) ## run the quick verification cases, which are part of make test
	@$(BIN) -m pytest verification -n logical --dist worksteal -m "not slow"

mutants: $(ALL) ## check that the cases and tests detect every registered wrong change of the code
	@$(BIN) -m verification.mutants

mutants-sampled: $(ALL) ## run a sample of machine-made mutants of repro/ against the tests; continues an interrupted session
	@$(PIP) --require-hashes --no-deps --only-binary :all: -r verification/mutants/machine/requirements.lock
	@$(BIN) -m verification.mutants.machine

test: $(ALL) ## run the tests and the quick verification cases on all cores
	@$(BIN) -m pytest tests verification -n logical --dist worksteal -m "not slow"

test-thorough: $(ALL) ## the same with more random examples, and the slow tests
	@HYPOTHESIS_PROFILE=thorough $(BIN) -m pytest tests verification -n logical --dist worksteal -m "not slow" $(SLOW)

oldest: $(OLDEST) ## run quick tests with the oldest accepted versions of the dependencies
	@$(dir $(OLDEST))bin/python -m pytest $(OLDEST_TESTS)

lint: $(ALL) ## check style and types with ruff and mypy
	@$(BIN) -m ruff check .
	@$(BIN) -m ruff check --select E501 --config line-length=100 repro
	@$(BIN) -m mypy

bench: $(ALL) ## measure time against error, cost against size, and cost and effect of each assumption
	@$(BIN) -m verification.bench
	@$(BIN) -m verification.throughput
	@$(BIN) -m verification.audit
	@$(BIN) -m verification.speed
	@$(BIN) -m paper_figures.replication

crate: $(STAMP) $(CRATE) ## pack scenes, code, environment, figures and claims as a Workflow Run RO-Crate, and validate it
	@$(BIN) -m paper_figures.crate
	@$(dir $(CRATE))bin/python .ci/crate_check.py paper_figures/out/crate

network: $(STAMP) $(NETWORK) ## run the example of a network with OpenPNM, and its test
	@$(dir $(NETWORK))bin/python docs/howto/openpnm_network.py
	@$(dir $(NETWORK))bin/python -m pytest tests/test_openpnm.py

gold: $(GOLD) ## compute the numbers of another code, NGSolve, anew: reference/gold/flow.json, pair.json and growth.json
	@$(dir $(GOLD))bin/python reference/gold/flow.py
	@$(dir $(GOLD))bin/python -m reference.gold.pair
	@$(dir $(GOLD))bin/python reference/gold/growth.py

docs: $(ALL) $(SITE) ## build the site into docs/_build/html, without network
	@$(dir $(SITE))bin/python -m sphinx -q -W --keep-going -b html -c docs . docs/_build/html
	@echo "docs/_build/html/index.html"

clean: ## remove .venv and all generated files
	@rm -rf $(VENV) paper_figures/out paper_figures/cache build docs/_build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis
	@find . -name .git -prune -o -type d -name __pycache__ -prune -exec rm -rf {} +

# The stamp is written last: an interrupted or failed install leaves none, and the next make starts from scratch.
$(STAMP): requirements.lock pyproject.toml
	@rm -f $@
	@command -v "$(PYTHON)" >/dev/null || { echo "error: there is no '$(PYTHON)'; name a Python 3.11 or newer: make PYTHON=/path/to/python3 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "error: Python 3.11 or newer is needed, '$(PYTHON)' is $$("$(PYTHON)" -V 2>&1); name another: make PYTHON=/path/to/python3 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || { echo "error: '$(PYTHON)' lacks the standard modules venv or ensurepip (Debian and Ubuntu ship them as python3-venv); install them or name another: make PYTHON=/path/to/python3 ..." >&2; exit 1; }
	@echo "Making $(VENV) with $$("$(PYTHON)" -V 2>&1) from requirements.lock; this takes 2 to 3 minutes."
	@"$(PYTHON)" -m venv --clear $(VENV)
	@$(PIP) --require-hashes --only-binary :all: -r requirements.lock
	@$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

$(ALL): verification/requirements.lock $(STAMP)
	@echo "Adding the packages of verification/requirements.lock to $(VENV); this takes a minute or two."
	@$(PIP) --require-hashes --no-deps --only-binary :all: -r verification/requirements.lock
	@touch $@

# The validator of `make crate`, and NGSolve of `make gold`, have separate environments.
$(CRATE) $(GOLD): build/%/.installed: .ci/%.lock
	@rm -f $@
	@"$(PYTHON)" -m venv --clear $(@D)
	@$(@D)/bin/python -m pip install -q --disable-pip-version-check --require-hashes --only-binary :all: -r $<
	@touch $@

# The site is built in an environment of its own, and OpenPNM runs in one; both also see the packages of .venv.
# One package that OpenPNM needs has no wheel.
$(NETWORK): SOURCES := --no-binary docrep
$(SITE) $(NETWORK): build/%/.installed: .ci/%.lock $(STAMP)
	@rm -f $@
	@"$(PYTHON)" -m venv --clear $(@D)
	@$(@D)/bin/python -m pip install -q --disable-pip-version-check --require-hashes --only-binary :all: $(SOURCES) -r $<
	@echo "import site; site.addsitedir('$$($(BIN) -c 'import sysconfig; print(sysconfig.get_path("purelib"))')')" > "$$($(@D)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/package.pth"
	@touch $@

# `make oldest` installs the lower bounds of the dependencies in a separate environment, for Python 3.11.
$(OLDEST): .ci/oldest.lock pyproject.toml
	@rm -f $@
	@"$(PYTHON)" -m venv --clear $(@D)
	@$(@D)/bin/python -m pip install -q --disable-pip-version-check --require-hashes --only-binary :all: -r .ci/oldest.lock
	@$(@D)/bin/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@
