# Two commands matter: make demo, make test. Both set everything up first.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
JOBS ?= 2

.PHONY: demo test test-slow test-slow-rotation dependencies planted lint meshes bench bench-smoke bench-peers performance verification extremes trust docs-pages wheel-check clean
.DEFAULT_GOAL := demo

# The matrices are small: threads of the linear algebra would only hinder each other.
export OPENBLAS_NUM_THREADS := 1

# What the tests of a file share is then computed by one worker, mostly.
PYTEST := -m pytest -n $(JOBS) --dist worksteal

# A copy, not a link to the source: the demo then proves what a plain `pip install .` gives.
$(VENV)/.demo: pyproject.toml $(shell find flexcam -type f -not -name '*.pyc')
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check .
	touch $@

$(VENV)/.dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@ $(VENV)/.demo

CASE := cases/tayeb/model-3-shm.toml
RESULT := results/model-3-shm.vtkhdf
REPORT := results/model-3-shm.html

demo: $(VENV)/.demo
	$(BIN)/flexcam compare $(CASE)
	@echo
	$(BIN)/flexcam run $(CASE) -o results --overwrite
	$(BIN)/flexcam export $(RESULT) --format pvd --overwrite
	@$(BIN)/flexcam report $(RESULT) -o $(REPORT) --overwrite >/dev/null
	@echo
	@echo "The motion in ParaView: open $(RESULT) (5.12 and newer) or results/model-3-shm.pvd (any),"
	@echo "apply Warp By Vector to 'displacement' (scale 1; docs/howto/paraview.md says how to magnify the bending of the shaft), then Tube, press play."
	@echo "The report, in any browser, without a network: $(REPORT)"

test: $(VENV)/.dev
	$(BIN)/python $(PYTEST)

test-slow: $(VENV)/.dev
	$(BIN)/python $(PYTEST) -m "slow or not slow"

# Every fault of tests/planted must make the suite fail.
planted: $(VENV)/.dev
	$(BIN)/python -m tests.planted.plant

lint: $(VENV)/.dev
	$(BIN)/ruff check flexcam tests meshes benchmarks docs examples hatch_build.py
	$(BIN)/ruff format --check flexcam tests meshes benchmarks docs examples hatch_build.py
	$(BIN)/basedpyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports
	$(MAKE) --no-print-directory prose

# Plain English in pages, messages, help and comments of cases: rules of docs/prose, by textlint of the npm registry.
TEXTLINT := $(VENV)/textlint-15.8.0
# Without the registry the prose is not checked, and a message says so.
.PHONY: prose
prose: | $(VENV)/.dev
	@test -d $(TEXTLINT)/node_modules/textlint || PATH="$(abspath $(BIN)):$$PATH" timeout 300 \
	  npm install --silent --no-audit --no-fund --prefix $(TEXTLINT) textlint@15.8.0 || rm -rf $(TEXTLINT)
	@rm -rf build/prose && $(BIN)/python docs/prose/python_text.py build/prose
	@if test -d $(TEXTLINT); then PATH="$(abspath $(BIN)):$$PATH" $(TEXTLINT)/node_modules/.bin/textlint \
	  --rulesdir docs/prose --format unix README.md CONTRIBUTING.md CHANGELOG.md SECURITY.md docs build/prose; \
	  else echo "textlint could not be installed from the npm registry: the prose is not checked"; fi

bench: $(VENV)/.dev
	$(BIN)/python -m pytest benchmarks --benchmark-only

# Comparison of flexcam with other solvers; solvers that are not installed are named and skipped.
bench-peers: $(VENV)/.dev
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[peers]'
	$(BIN)/python -m benchmarks.peers.comparison
	$(BIN)/python docs/make_performance.py

# The performance page, measured on this machine.
performance: $(VENV)/.dev
	$(BIN)/python docs/make_performance.py --measure

meshes: $(VENV)/.dev
	$(BIN)/python meshes/generate.py

# The site, in build/docs: every warning is an error, the gallery runs, the verification manual is made anew.
.PHONY: docs
docs: $(VENV)/.dev
	$(BIN)/python docs/make_verification.py
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --jobs $(JOBS) -d build/doctrees docs build/docs
	@echo "Open build/docs/index.html"

clean:
	rm -rf $(VENV) build dist results .pytest_cache .ruff_cache .hypothesis docs/gallery docs/reference/api docs/reference/commands

# Wheel and source archive, and the wheel used in an empty environment outside the tree.
wheel-check: $(VENV)/.dev
	$(BIN)/python tests/wheel_check.py dist

# Each benchmark once, to find errors.
bench-smoke: $(VENV)/.dev
	$(BIN)/python -m pytest benchmarks --benchmark-disable -q

# The normal suite with the lowest dependencies, and with the newest on every Python that is found.
dependencies:
	$(PYTHON) tests/dependencies.py

test-slow-rotation: $(VENV)/.dev
	$(BIN)/python tests/slow_rotation.py 240

# The verification manual, from the rows that the tests record.
verification: $(VENV)/.dev
	$(BIN)/python $(PYTEST) -m "slow or not slow" tests/verification
	$(BIN)/python docs/make_verification.py --take

# The page of extremes, from the rows that the tests record; `make test` and this script keep the rows of slow ones.
extremes: $(VENV)/.dev
	$(BIN)/python $(PYTEST) -m "slow or not slow" --ignore-glob="*_random_*" tests/extremes
	$(BIN)/python docs/make_extremes.py

# The page of bad input and injected faults, from the rows that the tests record; run the tests first.
trust: $(VENV)/.dev
	$(BIN)/python docs/make_trust.py

# Pages made from the code.
docs-pages: $(VENV)/.dev
	$(BIN)/python docs/make_case_format.py
