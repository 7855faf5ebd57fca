# Two commands do everything: `make demo` and `make test`. Both set up what they need first.
VENV := .venv
BIN := $(VENV)/bin
PYTHON := $(shell for p in python3.11 python3; do "$$p" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null && { echo "$$p"; break; }; done)

# What is imported is compiled once and kept, also for who has that switched off: tests start thousands of processes.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup demo test test-fast browser test-long test-all test-models lint format bench bench-quick docs pictures editor lock wheel image release release-check clean

setup: $(VENV)/.ready

$(VENV)/.ready: requirements.lock pyproject.toml
ifneq ($(PYTHON),)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
else ifneq ($(shell which uv 2>/dev/null),)
	test -x $(BIN)/python || uv venv --python 3.11 $(VENV)
	uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock
	uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e .
else
	@echo "Robomark needs CPython 3.11 with venv (PyBullet has wheels for no later one): install python3.11 and python3.11-venv, or uv, and run make again." >&2; exit 2
endif
	touch $@

demo: setup
	$(BIN)/robomark demo

# Three processes for two processors: many tests wait for other processes.
test: setup lint
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "not long" --durations 25

# The quick third, which needs no worker: the files that mark themselves as fast. The others are not even imported.
test-fast: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "fast and not long" $$(grep -rl --include='test_*.py' "pytest.mark.fast" tests)

# Replays are tried in Chromium, and skipped where it cannot be had.
browser:
	which chromium chromium-browser google-chrome > /dev/null 2>&1 || timeout 300 apt-get install -y -q chromium > /dev/null 2>&1 || true

test-long: setup browser
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "long and not training" --durations 40

test-all: test test-long

# Half an hour of training. To run when models/, the sensor's images or the versions of the libraries change.
test-models: setup
	$(BIN)/python -m pytest -n 2 -m training

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy tests
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix-only --quiet .
	$(BIN)/ruff format .

bench: setup
	$(BIN)/python -m benchmarks

# In less than a minute; fails when a ratio misses its budget.
bench-quick: setup
	$(BIN)/python -m benchmarks --quick

# The documentation as a site, in site/. Its tools have a virtual environment of their own; warnings are errors.
docs: .venv-docs/.ready
	.venv-docs/bin/python -m sphinx --quiet --fail-on-warning --keep-going -b html -c docs -d site/.doctrees . site
	@echo "site/docs/index.html"

.venv-docs/.ready: docs/requirements.lock
ifneq ($(PYTHON),)
	test -x .venv-docs/bin/python || $(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --require-hashes -r docs/requirements.lock
else
	test -x .venv-docs/bin/python || uv venv --python 3.11 .venv-docs
	uv pip install --quiet --python .venv-docs/bin/python --require-hashes -r docs/requirements.lock
endif
	touch $@

# The editor of the pages, service/web/static/editor.min.js, from service/web/editor. Needs Node.js and npm.
editor:
	cd service/web/editor && npm ci --silent && npm run --silent build

# The documents' pictures; needs Chromium, and minutes for the digits. `make pictures PICTURES=report` draws one.
pictures: setup
	$(BIN)/python docs/draw_pictures.py $(PICTURES)

wheel: setup
	$(BIN)/python -m hatchling build -t wheel
	cd notebook && ../$(BIN)/python -m hatchling build -t wheel -d ../dist

# Needs docker or podman.
CONTAINERS := $(shell which docker podman 2>/dev/null | head -n 1)

image: wheel
	$(CONTAINERS) build -f deploy/Dockerfile -t robomark .

# Checks, builds and tags the version in pyproject.toml; with docker or podman also makes the image. See deploy/release.py.
release: setup
	$(BIN)/python deploy/release.py

# The same without the tag and the image.
release-check: setup
	$(BIN)/python deploy/release.py --dry-run

# Needs uv; the lock files name no package index. The second is for images: what grading needs or may use, and nothing for tests.
# The third is for the documentation site.
LOCK := uv pip compile --quiet --generate-hashes --no-emit-index-url --no-header --python-version 3.11

lock:
	$(LOCK) pyproject.toml --extra test -o requirements.lock
	$(LOCK) pyproject.toml --extra tflite --no-annotate -c requirements.lock -o deploy/requirements.lock
	$(LOCK) --group docs --no-annotate -c requirements.lock -o docs/requirements.lock

clean:
	rm -rf $(VENV) .venv-docs dist site .mypy_cache .ruff_cache .pytest_cache robomark-demo
