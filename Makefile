# `make study` and `make test` need Python 3.10+ (with venv and pip) and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: study published-page test system accuracy planted check lint types benchmark publish lock clean

study: .venv/.study
	$(BIN)/crankslider run
	$(BIN)/crankslider report

# The page of the rows that are published.
published-page: .venv/.study
	$(BIN)/crankslider report --results reports/published/results --out published-page --quiet

test: .venv/.ready
	$(BIN)/python -m pytest -n 2 --dist loadfile

# The whole as its users have it: the wheel, whole pages, own engines, clusters, killed runs, the documentation's blocks.
system: .venv/.ready
	$(BIN)/python -m pytest -n 2 --dist loadfile -m system

# Every number that has a baseline, of all engines, and what they owe on every scene.
accuracy: .venv/.ready
	$(BIN)/python -m pytest -n 2 --dist loadfile -m accuracy

# Plants bugs of a catalogue in a copy and sees which test catches each; SAMPLE=12 draws some.
planted: .venv/.ready
	$(BIN)/python -m tests.planted_bugs $(if $(SAMPLE),--sample $(SAMPLE)) $(if $(SEED),--seed $(SEED))

lint: .venv/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/.ready
	$(BIN)/mypy

# All that CI does.
check: lint types test system accuracy
	$(MAKE) planted SAMPLE=10

# Times of the reference beside heyoka's, the limit of speed (pip install heyoka).
benchmark: .venv/.ready
	$(BIN)/python -m tests.benchmarks.limit

# Renew the quick set in reports/published from the committed code; a test recomputes it.
publish: .venv/.ready
	git diff --quiet HEAD -- reference_solver engine_models studies reports ':!reports/published' || \
	    { echo "error: commit the code first, so that the published results can name it"; exit 2; }
	rm -rf results && $(BIN)/crankslider run
	$(BIN)/python -m reports.publication reports/published results
	rm -rf reports/published/truth && $(BIN)/python -m crankslider.reference_solutions reports/published/truth

# What studies need, and no more. Modules are compiled when they are first imported, which most never are.
.venv/.study: study.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	    { echo "error: $(PYTHON) is older than Python 3.10; name a newer one: make PYTHON=python3.12"; exit 2; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps --no-compile -r study.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $@

.venv/.ready: requirements.lock .venv/.study
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r requirements.lock
	touch $@

# Renew the pinned, hashed versions from pyproject.toml. study.lock has what studies need of them, and what
# installs the project.
LOCK := $(BIN)/uv pip compile --universal --python-version 3.10 --generate-hashes --no-emit-index-url --no-header --quiet
lock: .venv/.ready
	$(LOCK) pyproject.toml --extra dev --upgrade -o requirements.lock
	echo setuptools | $(LOCK) pyproject.toml - --constraint requirements.lock -o study.lock

clean:
	rm -rf .venv results report published-page *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
