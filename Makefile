PYTHON ?= python3
VENV ?= .venv
LOCK ?= requirements.lock
CPU ?= x86-64-v2
BIN := $(VENV)/bin
# uv, where it is installed, takes seconds for what takes pip the better part of a minute
UV ?= $(shell command -v uv)
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
INSTALL = $(if $(UV),$(UV) pip install --quiet --python $(BIN)/python $(1) || )$(PIP) $(1)
# a Python that is asked for by name (make test PYTHON=python3.13) is the one of .venv: built again where it is another
ifneq ($(origin PYTHON),file)
  VERSION := import platform; print(platform.python_version())
  ifneq ($(shell $(PYTHON) -c "$(VERSION)"),$(shell $(BIN)/python -c "$(VERSION)" 2>/dev/null))
    ANOTHER := another-python
  endif
endif
# what can come out otherwise on another processor: all physics, the parts of the core that solve, the pages that do while one waits
SOLVING := tests/physics $(addprefix tests/unit/test_,kernels.py simulate.py map_engine.py bifurcation.py floquet.py spectrum.py \
  determinism.py threads.py quick_map.py what_if.py margin.py export.py cli.py) \
  $(addprefix tests/app/test_,operating_point.py bifurcation.py home.py my_bearing.py surrogates.py my_map.py)
# what can come out otherwise on another Python and, of what solves, on another processor: besides all physics what stores, reads,
# counts, imports and starts processes. What waits for nothing may run at low priority beside other work
PURE := tests/physics $(addprefix tests/unit/test_,kernels.py simulate.py design.py form.py artifacts.py export.py regimes.py lines.py \
  features.py source_hash.py)
TIMED := $(addprefix tests/unit/test_,determinism.py threads.py memory.py dependencies.py pretrained.py no_code.py surrogates.py jobs.py \
  cli.py cli_design.py cli_models.py refine.py) $(addprefix tests/app/test_,about.py view.py jobs.py my_bearing.py operating_point.py)
STORING := $(PURE) $(TIMED)
OLDEST := $(addprefix tests/unit/test_,design.py form.py export.py simulate.py map_engine.py surrogates.py) \
  $(addprefix tests/physics/test_,film.py integrators.py) $(addprefix tests/app/test_,about.py view.py home.py my_bearing.py)

.PHONY: run test test-fast coverage kernels quick-kernels compiled test-foreign test-python oldest test-oldest licences lint lock map train verify \
  bifurcations audit linear-table refined preset-maps manifest pictures results docs clean another-python

run: $(VENV)/.ready
	$(BIN)/spab dashboard

test: $(VENV)/.ready
	$(BIN)/python -m tests.kernels
	$(BIN)/python -m pytest

# what takes no more than a few seconds each, without pages and browser
test-fast: $(VENV)/.ready
	$(BIN)/python -m tests.kernels
	$(BIN)/python -m pytest -q -m "not slow" tests/unit tests/physics

# lines of spab_core, app.py and pages/ that the tests run; those of compiled kernels are not seen
coverage: $(VENV)/.ready
	$(BIN)/python -m pytest -q --cov=spab_core --cov=pages --cov=app --cov-report=term --cov-report=html:test-output/coverage

# compiled for another processor than this one, in a folder of kernels of its own: x86-64-v2 has no AVX and no fused products,
# x86-64-v3 is Haswell; CPU=native is this one
FOREIGN := NUMBA_CACHE_DIR=$(abspath $(VENV))/kernels-$(CPU)
ifneq ($(CPU),native)
  FOREIGN += NUMBA_CPU_NAME=$(CPU) NUMBA_CPU_FEATURES=
endif
COMPILE := -c "from spab_core.trajectory.compiling import compile_once; compile_once()"

test-foreign: kernels
	$(FOREIGN) $(BIN)/python -m pytest $(SOLVING)

# on another Python, without what takes more than a few seconds: make test-python PYTHON=python3.13 VENV=.venv-newest
test-python: quick-kernels
	$(FOREIGN) $(BIN)/python -m pytest -m "not slow" $(STORING)

kernels: $(VENV)/.ready
	$(FOREIGN) $(BIN)/python -m tests.kernels

quick-kernels: $(VENV)/.ready
	$(FOREIGN) $(BIN)/python -m tests.kernels --quick

compiled: $(VENV)/.ready
	$(FOREIGN) $(BIN)/python $(COMPILE)

# the oldest versions that pyproject.toml allows: core, view and what else depends on the libraries, without what takes more than
# a few seconds and the models kept for the newest ones
OLD := VENV=.venv-oldest LOCK=requirements-oldest.lock CPU=native

test-oldest: oldest
	NUMBA_CACHE_DIR=$(abspath .venv-oldest)/kernels-native .venv-oldest/bin/python -m pytest -q -m "not slow" $(OLDEST)

oldest:
	$(MAKE) $(OLD) compiled
	NUMBA_CACHE_DIR=$(abspath .venv-oldest)/kernels-native .venv-oldest/bin/python -m tests.kernels --oldest

lint: $(VENV)/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# the exact versions everything is tested with, for every platform and Python from 3.11 on
lock: $(VENV)/.ready
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra test --no-emit-index-url --no-header \
	  --output-file requirements.lock --upgrade pyproject.toml
	$(BIN)/uv pip compile --quiet --resolution lowest-direct --python-version 3.11 --extra test --no-emit-index-url --no-header \
	  --output-file requirements-oldest.lock --upgrade pyproject.toml
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra docs --no-emit-index-url --no-header \
	  --constraints requirements.lock --output-file requirements-docs.lock --upgrade pyproject.toml

# the shipped map: 42,500 cells, twenty minutes on two cores; an interrupted run goes on; then `make train`
map: $(VENV)/.ready
	$(BIN)/spab map --bearing-number 0.05:8.5:170 --rotor-mass 0.1:25:250 --out artifacts/reference_map.npz --workers 2
	$(BIN)/python -m spab_core.shipped.manifest

# scores, predicted maps and small models from the shipped map, the same to the bit on the same versions
train: $(VENV)/.ready
	$(BIN)/spab train --all --workers 2

# what is shipped is what the manifest says, and comes out of these versions, this design and this map
verify: $(VENV)/.ready
	$(BIN)/spab verify

# the paper's lines, swept cold, up and down
bifurcations: $(VENV)/.ready
	$(BIN)/spab bifurcation --vary rotor-mass --at 3.45 --range 0.1:25:500 --out artifacts/bifurcation_rotor_mass.npz --workers 2
	$(BIN)/spab bifurcation --vary bearing-number --at 4.52 --range 0.05:8.5:500 --out artifacts/bifurcation_bearing_number.npz --workers 2
	$(BIN)/python -m spab_core.shipped.manifest

# random cells of the shipped map again, finer and longer: docs/audit.csv
audit: $(VENV)/.ready
	$(BIN)/python benchmarks/audit_map.py

# after `make map`: what refining saves on it, artifacts/refined_map.npz (n/16 of its cells) and docs/learning_curve.csv
refined: $(VENV)/.ready
	$(BIN)/spab refine --map artifacts/reference_map.npz --budget 2656 --seed 10 --out artifacts/refined_map.npz
	$(BIN)/python -m spab_core.shipped.manifest
	$(BIN)/python benchmarks/learning_curve.py

# the tables of docs/results.md from the shipped scores, and its pictures, drawn in Chromium
results: $(VENV)/.ready
	$(BIN)/python docs/result_tables.py
	$(BIN)/python docs/draw_results.py

# maps of the presets, 256 cells each: ten minutes; an interrupted run goes on. Where the solver's code changed and its answers
# did not, `.venv/bin/python -m spab_core.shipped.preset_maps --restamp` shows it on some cells and names the present code
preset-maps: $(VENV)/.ready
	$(BIN)/python -m spab_core.shipped.preset_maps

# linear stability of the reference design over the plane, an input of surrogates: half a minute
linear-table: $(VENV)/.ready
	$(BIN)/python -m spab_core.linear_theory.linear_table

# the licences of all that is installed: docs/licences.md
licences: $(VENV)/.ready
	$(BIN)/python benchmarks/licences.py

# checksums of everything in artifacts/
manifest: $(VENV)/.ready
	$(BIN)/python -m spab_core.shipped.manifest

# the pictures of docs/dashboard.md and the README, taken in Chromium
pictures: $(VENV)/.ready
	$(BIN)/python docs/take_pictures.py

# the docs site in site/: docs/, README and its like, examples, API reference from the docstrings; a warning is an error
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "The docs site is in site/; to read it: $(BIN)/python -m http.server --directory site 8000"

$(VENV)/.docs: $(VENV)/.ready requirements-docs.lock
	$(call INSTALL,-r requirements-docs.lock)
	touch $@

$(VENV)/.ready: pyproject.toml $(LOCK) $(ANOTHER)
	$(PYTHON) -c "import sys; sys.exit(0 if sys.version_info >= (3, 11) else 'spab needs Python 3.11 or newer')"
	$(PYTHON) -m venv --clear $(VENV)
	$(call INSTALL,-r $(LOCK))
	$(call INSTALL,--no-deps --editable .)
	touch $@

clean:
	rm -rf .venv .venv-oldest .venv-newest .ross .uv build site *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
