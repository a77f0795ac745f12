# Two commands do everything on a machine with Python 3.10-3.13, make and git:
#   make demo    identify a simulated robot over DDS and prove that a replay agrees
#   make test    run the whole suite
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test lint format coverage bench docs venv clean

demo: venv
	$(BIN)/sgp demo

test: $(VENV)/.test
	$(BIN)/python -m pytest

lint: $(VENV)/.lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(VENV)/.lint
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

coverage: $(VENV)/.test
	$(BIN)/python -m pytest test/core test/engine test/contracts test/robots \
	    --cov=sgp_ros.core --cov=sgp_ros.engine --cov-branch --cov-fail-under=95

bench: $(VENV)/.test
	$(BIN)/python -m benchmarks.filter

docs: $(VENV)/.test
	$(BIN)/python -m pytest test/test_documents.py

venv: $(VENV)/.package

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || \
	    { echo "found `$(PYTHON) --version`, expected Python 3.10 to 3.13; call make PYTHON=python3.11" >&2; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' || \
	    { echo "this Python has no venv module; on Debian: apt install python3-venv" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=23' 'setuptools>=68,<80'

$(VENV)/.package: setup.py | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[wheels]'
	@touch $@

$(VENV)/.test: setup.py | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[wheels,test]'
	@touch $(VENV)/.package $@

$(VENV)/.lint: setup.py | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[wheels,test,lint]'
	@touch $(VENV)/.package $(VENV)/.test $@

clean:
	rm -rf $(VENV) .venv-oldest build install log out *.egg-info
