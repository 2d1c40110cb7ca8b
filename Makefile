# Needs make and a Python of at least 3.11 (with venv); everything else goes into .venv, in this folder.
#
#   make demo     run the two-finger example on the ladder of models; table, runs and figure in out/
#   make test     lint, compile the kernels, run the tests
#   make long     run the tests that take long: more members of each class, longer runs, larger scenes
#   make pages    run what README, pages and examples show, and compare what it prints
#   make elsewhere    run the tests as on other processors; some of them: make elsewhere TESTS="tests/planning tests/sets"
#   make bench    run the benchmarks
#   make mutants  put deliberate faults into a copy one by one; say which of them the nearest tests miss
#   make wheel    build a wheel in dist/ that brings its kernels, compiled for any processor of this platform
#   make docs     build the documentation in out/docs/VERSION; warnings are errors
#   make lint     formatting, style, types, layers; changes nothing
#   make format   rewrite the sources in the project's format
#   make clean    remove .venv, caches and builds (never results)
#
# Another interpreter: make demo PYTHON=path/to/python

VENV := .venv
BIN := $(VENV)/bin

# Present after `pip install -e .`, `.[view]`, `.[dev]` and `.[docs]`; out of date when pyproject.toml changes.
INSTALLED := $(VENV)/.installed
INSTALLED_VIEW := $(VENV)/.installed-view
INSTALLED_DEV := $(VENV)/.installed-dev
INSTALLED_DOCS := $(VENV)/.installed-docs

# Run, not just looked up: a name on the PATH may be a shim with nothing behind it.
SUITABLE := import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for python in python3.13 python3.12 python3.11 python3; do \
	if $$python -c '$(SUITABLE)' >/dev/null 2>&1; then echo $$python; break; fi; done)

PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test long pages elsewhere kernels runs solvers bench mutants wheel docs clean lint format

demo: $(INSTALLED_VIEW)
	$(BIN)/python examples/two_finger_ladder.py

# Kernels are compiled and cached once, by two processes, before tests need them in parallel.
test: $(INSTALLED_DEV)
	$(MAKE) --jobs 2 runs lint solvers
	$(BIN)/python -m pytest -n 2 --dist loadfile

long: $(INSTALLED_DEV)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m long

pages: $(INSTALLED_DEV)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m 'pages and not long'

# The kernels of BLAS that other processors take, where this one can run them; and our kernels for any processor.
CAN = $(shell grep -qw $(1) /proc/cpuinfo 2>/dev/null && echo $(2))
BLAS = $(if $(filter x86_64,$(shell uname -m)),Prescott $(call CAN,avx2,Haswell) $(call CAN,avx512f,SkylakeX))
ANY_PROCESSOR := NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES=

elsewhere: $(BLAS:%=with-%) with-any-processor

with-any-processor: $(INSTALLED_DEV)
	$(ANY_PROCESSOR) $(MAKE) --jobs 2 kernels
	$(ANY_PROCESSOR) $(BIN)/python -m pytest -n 2 --dist loadfile $(TESTS)

with-%: $(INSTALLED_DEV)
	OPENBLAS_CORETYPE=$* $(BIN)/python -m pytest -n 2 --dist loadfile $(TESTS)

kernels: runs solvers

runs: $(INSTALLED_DEV)
	$(BIN)/python -W ignore::RuntimeWarning -m rungwise.compilation runs

solvers: $(INSTALLED_DEV)
	$(BIN)/python -W ignore::RuntimeWarning -m rungwise.compilation problems space

bench: $(INSTALLED)
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/race.py
	$(BIN)/python benchmarks/solvers.py

# Goes on where it was interrupted; some alone: make mutants FAULTS="witness-farthest fall-without-2"
mutants: $(INSTALLED_DEV)
	$(BIN)/python benchmarks/mutants.py $(FAULTS)

wheel: $(INSTALLED_DEV)
	rm -rf build/kernels
	NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= RUNGWISE_CACHE=build/kernels \
		$(BIN)/python -W ignore::RuntimeWarning -m rungwise.compilation
	RUNGWISE_KERNELS=build/kernels $(BIN)/python -m hatchling build -t wheel -d dist

# Links between pages are checked, too. A folder for each version, so that one can be published beside another.
docs: $(INSTALLED_DOCS)
	rm -rf docs/api
	$(BIN)/sphinx-build -q -W --keep-going -j 2 -d out/doctrees docs \
		out/docs/$$($(BIN)/python -c 'import rungwise; print(rungwise.__version__)')
	rm -rf out/docs/jupyter_execute

lint: $(INSTALLED_DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(INSTALLED_DEV)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) build dist docs/api .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name .git -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

# A .venv that works is kept, whoever made it; one that is missing or broken is made anew.
$(INSTALLED): pyproject.toml
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || { \
		python="$(PYTHON)"; \
		"$$python" -c '$(SUITABLE)' >/dev/null 2>&1 || { \
			echo "rungwise needs Python 3.11 or newer with venv and ensurepip; name one with PYTHON=path/to/python" >&2; \
			exit 1; }; \
		echo "$$python -m venv $(VENV)"; \
		"$$python" -m venv --clear $(VENV); }
	$(PIP_INSTALL) -e .
	$(BIN)/python -m compileall -q src/rungwise
	@touch $@

$(INSTALLED_VIEW): $(INSTALLED)
	$(PIP_INSTALL) -e '.[view]'
	@touch $@

$(INSTALLED_DEV): $(INSTALLED)
	$(PIP_INSTALL) -e '.[dev]'
	@touch $@

$(INSTALLED_DOCS): $(INSTALLED)
	$(PIP_INSTALL) -e '.[docs]'
	@touch $@
