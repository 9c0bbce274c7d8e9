PYTHON ?= python3
BIN := .venv/bin

.PHONY: run test lint lock map manifest pictures clean

run: .venv/.ready
	$(BIN)/streamlit run app.py

test: .venv/.ready
	$(BIN)/python -m pytest

lint: .venv/.ready
	$(BIN)/ruff check .
	$(BIN)/mypy

# the exact versions everything is tested with, for every platform and Python from 3.11 on
lock: .venv/.ready
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra test --no-emit-index-url --no-header \
	  --output-file requirements.lock --upgrade pyproject.toml

# the shipped map: half an hour on one core, a quarter on two
map: .venv/.ready
	$(BIN)/spab map --bearing-number 0.25:8.5:34 --rotor-mass 0.5:25:50 --out artifacts/reference_map.npz --workers 2
	$(BIN)/python -m spab_core.artifacts

# checksums of everything in artifacts/
manifest: .venv/.ready
	$(BIN)/python -m spab_core.artifacts

# the README's picture of the dashboard, taken in Chromium
pictures: .venv/.ready
	$(BIN)/python docs/take_pictures.py

.venv/.ready: pyproject.toml requirements.lock
	$(PYTHON) -c "import sys; sys.exit(0 if sys.version_info >= (3, 11) else 'spab needs Python 3.11 or newer')"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

clean:
	rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
