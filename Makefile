# Everything runs from .venv, made from pyproject.toml on first use.
# the first Python from 3.11 on that is found; another by make PYTHON=...
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3 python; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo study test test-all lint kernels sources bench docs gallery clean

demo: $(VENV)/.installed
	$(BIN)/python examples/demo.py

study: $(VENV)/.installed
	$(BIN)/python -m benchmarks run study --publish

# files in the order of their names: those that take longest come first
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# tests start many processes: a compiled source is imported in 60 % of the time
test test-all sources: export PYTHONDONTWRITEBYTECODE :=

test: $(VENV)/.installed
	$(MAKE) --no-print-directory -j2 lint kernels sources
	$(PYTEST) -m "not slow"

# the slow tests, which `test` leaves out
test-all: $(VENV)/.extras kernels
	$(PYTEST) -m slow

# each kernel is compiled once, in two processes; without this both workers of the tests compile most of them
kernels: kernels-light-field kernels-others
kernels-%: $(VENV)/.installed
	$(BIN)/python -m tests.support.kernels $*

# tests are read once, in a process of its own while others compile: each worker would take twice as long for it
sources: $(VENV)/.installed
	$(BIN)/python -m pytest -q --collect-only -m "not slow" >/dev/null

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed
	$(BIN)/python -m benchmarks run ratios

# seconds; with the viewer pages of the gallery if `make gallery` has made them
docs: $(VENV)/.docs
	$(BIN)/mkdocs build --strict -f docs/site/mkdocs.yml

# some 20 minutes of CPU time; one with GALLERY_SCALE=16, for small pages
GALLERY_SCALE ?= 2
gallery: $(VENV)/.installed
	$(BIN)/python -m benchmarks run gallery --missing --scale $(GALLERY_SCALE)

$(VENV)/.docs: $(VENV)/.installed
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[docs]"
	touch $@

# coders to compare with and what drives a browser; what cannot be had is tried again the next time
$(VENV)/.extras: $(VENV)/.installed
	for extra in anchors browser; do \
	  $(BIN)/python -m pip install -q --disable-pip-version-check -e ".[$$extra]" || \
	    { echo "no $$extra: their tests are skipped" >&2; missing=1; }; done; test -n "$$missing" || touch $@

# sources of which little or nothing is imported: compiling them would take 5 s
UNUSED := '/(tests|fontTools|mypyc?|pip|pkg_resources|pygments|setuptools)/'
$(VENV)/.installed: pyproject.toml
	"$(PYTHON)" -c "" 2>/dev/null || { echo "no Python from 3.11 on was found: install one or type make PYTHON=..." >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --no-compile --disable-pip-version-check -e ".[dev]"
	$(BIN)/python -m compileall -q -j 0 -x $(UNUSED) $(VENV)/lib >/dev/null || true  # pip would do it on one core
	touch $@

clean:
	rm -rf $(VENV) out build *.egg-info
