# Debian or Ubuntu on x86-64 with Python 3.10 to 3.13; no ROS installation is needed or used.
# `make demo ARGS='--duration 20'` and `make test ARGS=test/ground` pass arguments on.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input

# What an installation puts somewhere, directories too, so that a removed file counts as a change.
SOURCES := package.xml setup.py setup.cfg pyproject.toml \
  $(shell find deck_motion_ros config launch resource -not -name '*.pyc' -not -name __pycache__)

# Nothing leaves this host, nothing outside it or beside it is heard.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export ROS_DOMAIN_ID := $(shell shuf -i 1-101 -n 1)
export ROS_LOG_DIR := $(CURDIR)/$(VENV)/log
export OPENBLAS_NUM_THREADS := 1
# What a sourced ROS installation or another environment would mix in.
unexport PYTHONPATH PYTHONHOME LD_LIBRARY_PATH AMENT_PREFIX_PATH COLCON_PREFIX_PATH
unexport RMW_IMPLEMENTATION ROS_LOCALHOST_ONLY ROS_STATIC_PEERS ROS_DISCOVERY_SERVER
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test check bench docs clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\): .*## /make \1\t/p' $(MAKEFILE_LIST) | expand -t 12

demo: $(VENV)/demo.stamp ## simulated ship, predictor and recorder on real ROS 2 nodes: a bag and a report
	@$(BIN)/deck_motion demo $(ARGS)

test: $(VENV)/test.stamp ## run all tests on the installed package
	@$(BIN)/pytest $(ARGS)

check: $(VENV)/test.stamp ## lint, types, rooms
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-cache

bench: $(VENV)/test.stamp ## measure the performance figures
	@$(BIN)/deck_motion bench $(ARGS)

docs: $(VENV)/test.stamp ## write doc/interfaces.md from the tables in the code
	@$(BIN)/python -m deck_motion_ros.documentation doc/interfaces.md

clean: ## remove everything that make, pip and colcon made here
	@rm -rf $(VENV) build install log *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache
	@find deck_motion_ros test -name __pycache__ -prune -exec rm -rf {} +

$(VENV)/demo.stamp: extras := ros
$(VENV)/test.stamp: extras := ros,test
$(VENV)/%.stamp: $(SOURCES) | $(BIN)/python
	@echo 'Installing deck_motion_ros[$(extras)] into $(VENV) (about half a minute the first time)'
	@rm -rf build/lib build/bdist.*
	@$(PIP) install -qq '.[$(extras)]'
	@touch $@

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' || \
	  { echo 'Python 3.10 to 3.13 is needed, for example: make PYTHON=python3.12 ...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo '$(PYTHON) makes no virtual environments here; cure: apt install python3-venv' >&2; exit 1; }
	@echo "Making $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV)
