# make demo   learn, serve, replay, validate, report, trace a change: the main job, end to end
# make test   lint, types, tests but for the long ones
# make test-all  those too: whole studies, many repetitions, hours of a rig
# make docs   the documentation site in out/site; a broken link fails
# All build .venv themselves and write into ignored folders only.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find push_predictor push_predictor_paper msg_adapters launch config scripts -type f -not -name '*.pyc' -not -name '*.so' -not -path '*/build/*' -not -path '*.egg-info/*') setup.py setup.cfg pyproject.toml package.xml
INTERFACES := $(shell find push_predictor_interfaces -type f -not -path '*/build/*')
# One process or robot must not hear another's demo or tests (ROS_DOMAIN_ID is theirs to choose).
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Matrices of a thousand rows gain nothing from a second thread, and two processes lose much by it.
export OPENBLAS_NUM_THREADS ?= 1
export PYTHONUNBUFFERED := 1
PACKAGES := $(VENV)/.dependencies
MARKERS := -m "not long"
unexport PYTHONPATH AMENT_PREFIX_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: demo test test-all lint style types suite docs bags clean

demo: $(VENV)/.installed
	$(BIN)/python -m examples.demo

# Types beside the suite: mypy, 40 s of one core on a new machine, needs no other result.
test: style
	$(MAKE) --no-print-directory -j 2 types suite MARKERS='$(MARKERS)'

test-all: MARKERS :=
test-all: test

lint: style types

# What only the tests need is installed beside the compilation of the messages.
test test-all lint style types suite: PACKAGES := $(VENV)/.tools

style: $(VENV)/.installed $(VENV)/.tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed $(VENV)/.tools
	$(BIN)/mypy

# Four workers on two cores: tests of nodes wait for each other's messages.
suite: $(VENV)/.installed $(VENV)/.tools $(VENV)/.compiled
	$(BIN)/python -m pytest -n 4 --dist loadfile --no-loadscope-reorder $(MARKERS)

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo out/site/index.html

bags: $(VENV)/.installed
	scripts/make_bags.sh

clean:
	rm -rf $(VENV) build out install log *.egg-info
	find push_predictor -name '*.so' -delete

$(VENV)/.python:
	$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13) and "Python 3.10 to 3.13 is needed, this is " + sys.version)'
	$(PYTHON) -m venv $(VENV)
	touch $@

# The site is built from the sources: no ROS needed.
$(VENV)/.docs: $(VENV)/.python setup.py
	$(BIN)/pip install -qq '.[docs]'
	touch $@

# Compiling the message package takes most of the time: only when it changes, and while all else is installed. In an
# environment of its own: CMake also searches that of pip, where packages would be there in part.
$(VENV)/.wheel: $(VENV)/.python $(INTERFACES)
	$(PYTHON) -m venv $(VENV)/builder
	$(VENV)/builder/bin/pip wheel -qq --no-deps --wheel-dir $(VENV)/wheels ./push_predictor_interfaces
	touch $@

# Python compiles what is imported: a tenth of these packages. tf2_msgs is not on PyPI.
$(VENV)/.dependencies: $(VENV)/.python setup.py push_predictor_paper/setup.py scripts/install_interfaces.sh scripts/install_tf2_msgs.sh
	$(BIN)/pip install -qq --no-compile 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces '.[report,live]' ./push_predictor_paper
	PATH="$(CURDIR)/$(BIN):$$PATH" scripts/install_tf2_msgs.sh
	touch $@

$(VENV)/.tools: $(VENV)/.dependencies
	$(BIN)/pip install -qq --no-compile '.[gym,import,test]'
	touch $@

# Four workers that import everything at once would each compile it: half a minute of two cores. Once, beside mypy;
# what is wrong with a test file, the suite says.
$(VENV)/.compiled: | $(VENV)/.installed $(VENV)/.tools
	-$(BIN)/python -m pytest --collect-only -qq > $@

$(VENV)/.interfaces: $(VENV)/.python $(INTERFACES) setup.py push_predictor_paper/setup.py
	$(MAKE) -j 2 $(VENV)/.wheel $(PACKAGES)
	$(BIN)/pip install -qq --force-reinstall --no-deps $(VENV)/wheels/*.whl
	touch $@

# Tests and the demonstration run from the checkout: the modules that pip compiled (in build/, once) go there too.
$(VENV)/.installed: $(VENV)/.interfaces $(SOURCES)
	$(BIN)/pip install -qq --no-deps --force-reinstall . ./push_predictor_paper
	cd $(BIN)/../lib/python3*/site-packages && find push_predictor -name '*.so' -exec cp --parents -p {} '$(CURDIR)' \;
	touch $@
