# Everything a newcomer needs: `make demo` and `make test`. Each makes .venv when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test bench lint types clean help

help:
	@echo "make demo   see the filter work on a drive that it renders itself (results in demo-out/)"
	@echo "make test   run the tests"
	@echo "make bench  measure detection quality and speed against other methods (tables in benchmarks/results/)"
	@echo "make lint   ruff;  make types   mypy, strict;  make clean   remove .venv and what was built"

# One stamp per set of dependencies, so that the demo does not install the test tools.
$(VENV)/.run: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[plot]"
	touch $@

$(VENV)/.dev: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $@ $(VENV)/.run

demo: $(VENV)/.run
	$(BIN)/lcf-edge demo --out demo-out

test: $(VENV)/.dev
	$(BIN)/python -m pytest

bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks.run $(BENCH)

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

clean:
	rm -rf $(VENV) demo-out dist .pytest_cache .mypy_cache .ruff_cache
