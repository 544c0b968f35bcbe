# The whole set-up lives in .venv; it is renewed when pyproject.toml changes.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
RECORDING := recordings/palpation-$(shell date +%Y%m%d-%H%M%S)
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)

.PHONY: demo test check docs format clean
.DELETE_ON_ERROR:

demo: $(VENV)/.all ## run the palpation scenario, record it and write a report
	trocar run palpation --record $(RECORDING)
	trocar report $(RECORDING) -o $(RECORDING).html

test: check ## everything that must hold before a change is merged; tests/docs builds the documentation
	@# three on two cores, as a third of the time they wait; then those that take all cores, one after the other;
	@# one whose patience ends beside the others must pass by itself (exit code 1: all tests were run)
	pytest -n 3 --dist loadgroup -m "not alone"; others=$$?; [ $$others -le 1 ] && \
	{ pytest -m alone; alone=$$?; [ $$alone -le 1 ]; } && \
	{ [ $$others$$alone = 00 ] || \
	{ python tests/failed_tests.py > .pytest_cache/failed && pytest @.pytest_cache/failed; }; }

docs: $(VENV)/.dev ## the documentation, in build/site
	NO_MKDOCS_2_WARNING=1 mkdocs build --strict

check: $(VENV)/.dev
	ruff check .
	ruff format --check .
	pyright
	lint-imports

format: $(VENV)/.dev
	ruff check --fix .
	ruff format .

clean:
	rm -rf $(VENV) build dist

# Debian splits ensurepip into python3-venv; where that is missing, pip (which is there) fills the environment.
$(VENV)/bin/pip:
	$(PYTHON) -m venv --clear $(VENV) 2>/dev/null || \
	{ $(PYTHON) -m venv --clear --without-pip $(VENV) && $(PYTHON) -m pip --python $(VENV)/bin/python install --quiet pip; }

$(VENV)/.all: pyproject.toml | $(VENV)/bin/pip
	$(VENV)/bin/python -m pip install --quiet --editable '.[all]'
	touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/pip
	$(VENV)/bin/python -m pip install --quiet --editable '.[dev]'
	touch $@
