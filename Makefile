PYTHON ?= python3
BIN := .venv/bin
OLDEST := $(addprefix tests/unit/test_,design.py form.py export.py threads.py kernels.py simulate.py map_engine.py surrogates.py) \
  $(addprefix tests/physics/test_,film.py integrators.py points.py) $(addprefix tests/app/test_,about.py view.py home.py my_bearing.py)

.PHONY: run test oldest test-oldest licences lint lock map train verify bifurcations audit linear-table refined manifest pictures results clean

run: .venv/.ready
	$(BIN)/spab dashboard

test: .venv/.ready
	$(BIN)/python -m pytest

# the oldest versions that pyproject.toml allows: core, view and what else depends on the libraries, without the models kept for
# the newest ones
test-oldest: oldest
	NUMBA_CACHE_DIR=.venv-oldest/kernels .venv-oldest/bin/python -m pytest -q $(OLDEST)

oldest: .venv-oldest/.ready
	NUMBA_CACHE_DIR=.venv-oldest/kernels .venv-oldest/bin/python -c "from spab_core.map_engine import compile_once; compile_once()"

lint: .venv/.ready
	$(BIN)/ruff check .
	$(BIN)/mypy

# the exact versions everything is tested with, for every platform and Python from 3.11 on
lock: .venv/.ready
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra test --no-emit-index-url --no-header \
	  --output-file requirements.lock --upgrade pyproject.toml
	$(BIN)/uv pip compile --quiet --resolution lowest-direct --python-version 3.11 --extra test --no-emit-index-url --no-header \
	  --output-file requirements-oldest.lock --upgrade pyproject.toml

# the shipped map: 42,500 cells, three quarters of an hour on two cores; an interrupted run goes on; then `make train`
map: .venv/.ready
	$(BIN)/spab map --bearing-number 0.05:8.5:170 --rotor-mass 0.1:25:250 --out artifacts/reference_map.npz --workers 2
	$(BIN)/python -m spab_core.artifacts

# scores, predicted maps and small models from the shipped map, the same to the bit on the same versions
train: .venv/.ready
	$(BIN)/spab train --all --workers 2

# what is shipped is what the manifest says, and comes out of these versions, this design and this map
verify: .venv/.ready
	$(BIN)/spab verify

# the paper's lines, swept cold, up and down
bifurcations: .venv/.ready
	$(BIN)/spab bifurcation --vary rotor-mass --at 3.45 --range 0.1:25:500 --out artifacts/bifurcation_rotor_mass.npz --workers 2
	$(BIN)/spab bifurcation --vary bearing-number --at 4.52 --range 0.05:8.5:500 --out artifacts/bifurcation_bearing_number.npz --workers 2
	$(BIN)/python -m spab_core.artifacts

# random cells of the shipped map again, finer and longer: docs/audit.csv
audit: .venv/.ready
	$(BIN)/python benchmarks/audit_map.py

# after `make map`: what refining saves on it, artifacts/refined_map.npz (n/16 of its cells) and docs/learning_curve.csv
refined: .venv/.ready
	$(BIN)/spab refine --map artifacts/reference_map.npz --budget 2656 --seed 10 --out artifacts/refined_map.npz
	$(BIN)/python -m spab_core.artifacts
	$(BIN)/python benchmarks/learning_curve.py

# the pictures of docs/results.md, drawn in Chromium
results: .venv/.ready
	$(BIN)/python docs/draw_results.py

# linear stability of the reference design over the plane, an input of surrogates: half a minute
linear-table: .venv/.ready
	$(BIN)/python -m spab_core.features

# the licences of all that is installed: docs/licences.md
licences: .venv/.ready
	$(BIN)/python benchmarks/licences.py

# checksums of everything in artifacts/
manifest: .venv/.ready
	$(BIN)/python -m spab_core.artifacts

# the pictures of docs/dashboard.md and the README, taken in Chromium
pictures: .venv/.ready
	$(BIN)/python docs/take_pictures.py

.venv-oldest/.ready: pyproject.toml requirements-oldest.lock
	$(PYTHON) -m venv .venv-oldest
	.venv-oldest/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-oldest.lock
	.venv-oldest/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

.venv/.ready: pyproject.toml requirements.lock
	$(PYTHON) -c "import sys; sys.exit(0 if sys.version_info >= (3, 11) else 'spab needs Python 3.11 or newer')"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

clean:
	rm -rf .venv .venv-oldest build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
