# Two commands do everything on a machine with Python 3.10-3.13, make and git:
#   make demo    identify a simulated robot over DDS and prove that a replay agrees
#   make test    run the suite
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OLDEST := .venv-oldest
# A test that hangs is named and ends the run; none takes a tenth of this.
PYTEST := -m pytest -o faulthandler_timeout=900 -o faulthandler_exit_on_timeout=true
NUMERIC := test/gp test/contracts test/physics test/rigid test/robots test/engine test/batch test/simulation

# rclpy of .venv and a ROS that was sourced before do not mix: forget the other one.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

.PHONY: demo test proofs busy lint format coverage oldest bench reproduce docs site venv clean

demo: venv
	$(BIN)/sgp demo

# One process a core; a file's tests stay together, so that they share what they prepare. A process
# that dies is named and not replaced: pytest-xdist 3.8 may wait for ever on the one that takes over.
# With MEASURE=1 it fails where less than 95 % of the lines and branches are entered of the layers that
# pyproject.toml names. A second command checks that: SlipCover 1.1, asked to do so where several
# processes measured, writes a table without their numbers.
MEASURED := $(VENV)/coverage
test: $(VENV)/.test
	$(BIN)/python $(if $(MEASURE),-m slipcover --dont-wrap-pytest --json --out $(MEASURED).json) $(PYTEST) -n auto --dist loadfile --max-worker-restart 0
	@$(if $(MEASURE),$(BIN)/python -m slipcover --merge $(MEASURED).json --out $(MEASURED).json --skip-covered --fail-under 95 \
	    > $(MEASURED).txt || { cat $(MEASURED).txt; echo 'the tests enter less than 95 % of these lines and branches' >&2; exit 1; })

# The tests that take long, with their results in docs/long_tests.md.
proofs: $(VENV)/.test
	$(BIN)/python -m sgp_proof.long_tests
	$(BIN)/python docs/generate_long_tests.py

lint: $(VENV)/.lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

format: $(VENV)/.lint
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# A robot's computer is never idle: the tests of the graph once more, beside two busy loops.
busy: $(VENV)/.test
	@while :; do :; done & one=$$!; while :; do :; done & two=$$!; \
	    trap 'kill $$one $$two' EXIT; $(BIN)/python $(PYTEST) -q test/ros; exit $$?

coverage:
	$(MAKE) test MEASURE=1

oldest: $(OLDEST)/.made
	$(OLDEST)/bin/python -c 'import numpy, scipy; print("numpy", numpy.__version__, "scipy", scipy.__version__)'
	NUMBA_CACHE_DIR=$(OLDEST)/numba $(OLDEST)/bin/python $(PYTEST) -q $(NUMERIC)

bench: $(VENV)/.test
	$(BIN)/sgp bench
	$(BIN)/python -m sgp_proof.numerics.filter
	$(BIN)/python -m sgp_proof.numerics.regressor

reproduce: venv
	$(BIN)/sgp reproduce

docs: $(VENV)/.test
	$(BIN)/python $(PYTEST) test/test_documents.py

# The documentation as static pages, warnings are errors.
site: $(VENV)/.lint
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

venv: $(VENV)/.package

# Each stamp says that the step before it ended well.
$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || \
	    { echo "found `$(PYTHON) --version 2>&1`, expected Python 3.10 to 3.13; call make PYTHON=python3.11" >&2; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' || \
	    { echo "this Python has no venv module; on Debian: apt install python3-venv" >&2; exit 2; }
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=23' 'setuptools>=68,<80'
	@touch $@

$(VENV)/.package: setup.py | $(VENV)/.made
	$(BIN)/python -m pip install --quiet --editable '.[wheels]'
	$(BIN)/sgp compile --quiet
	@touch $@

$(VENV)/.test: setup.py | $(VENV)/.made
	$(BIN)/python -m pip install --quiet --editable '.[wheels,test]'
	@touch $(VENV)/.package $@

$(VENV)/.lint: setup.py | $(VENV)/.made
	$(BIN)/python -m pip install --quiet --editable '.[wheels,test,lint,docs]'
	@touch $(VENV)/.package $(VENV)/.test $@

# The numeric layers alone, on what Ubuntu 24.04 ships; without ROS, and without Pinocchio, of which
# no wheel goes with NumPy 1.26.
$(OLDEST)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 12))' || \
	    { echo "found `$(PYTHON) --version 2>&1`, expected Python 3.10 to 3.12: NumPy 1.26 has no wheel for it" >&2; exit 2; }
	$(PYTHON) -m venv --clear $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet 'numpy==1.26.4' 'scipy==1.11.4' 'numba>=0.59' \
	    pyyaml jinja2 matplotlib mcap rosbags clarabel pytest hypothesis scikit-learn mpmath
	@touch $@

clean:
	rm -rf $(VENV) $(OLDEST) build install log out *.egg-info
