# The whole set-up lives in .venv; it is renewed when pyproject.toml changes.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
RECORDING := recordings/palpation-$(shell date +%Y%m%d-%H%M%S)
# Tests by what they need: markers in pyproject.toml. Four processes on two cores, as they wait a third of the time.
NEEDS := ros or browser or release or long or search
PYTEST := pytest -n 4 --dist loadgroup
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)

.PHONY: demo test test-all check docs gallery format clean
.DELETE_ON_ERROR:

demo: $(VENV)/.all ## run the palpation scenario, record it and write a report
	trocar run palpation --record $(RECORDING)
	trocar report $(RECORDING) -o $(RECORDING).html

test: $(VENV)/.dev ## the behaviour of the code: tests that need Python, a C compiler and two cores, and nothing else
	$(PYTEST) -m "not ($(NEEDS)) and not alone"

test-all: test ## everything: also tests with ROS, a browser, fresh environments, seconds or minutes of simulation, all cores
	$(PYTEST) -m "($(NEEDS)) and not (alone or browser)"
	pytest -m "alone or browser"

docs: $(VENV)/.dev ## the documentation, in build/site
	NO_MKDOCS_2_WARNING=1 mkdocs build --strict

gallery: $(VENV)/.dev ## the pictures and films of docs/gallery.md, drawn from the scenarios
	python docs/tools/gallery.py
	python docs/tools/page_looks.py

check: $(VENV)/.dev ## form, types, rules of imports, prose
	ruff check .
	ruff format --check .
	pyright
	lint-imports
	python docs/tools/wrap.py --check
	python docs/tools/decisions.py
	python docs/tools/addresses.py
	python docs/tools/words.py

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

$(VENV)/.dev: pyproject.toml $(wildcard */*.[ch] */*/*.[ch]) | $(VENV)/bin/pip
	$(VENV)/bin/python -m pip install --quiet --editable '.[dev]'
	touch $@
