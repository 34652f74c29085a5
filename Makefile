# The workspace's commands; `make help` lists them. Everything they install stays in this folder (.venv build install log),
# but for caches of cargo, fcslc and matplotlib in the home directory.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup build demo test wheels verify bench interop hardware lint format clean

ENV := . scripts/env.sh &&
PYTHON_DIRS := conftest.py fcsl_compiler fcsl_hal fcsl_runtime fcsl_sim fcsl_bridge fcsl_msgs examples scripts test
C_FILES = $$(git ls-files --cached --others --exclude-standard '*.c' '*.h' '*.cpp' '*.hpp' | while read -r f; do [ ! -e "$$f" ] || echo "$$f"; done)

help: ## list the commands
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/\1\t\2/' | while IFS=$$'\t' read -r t d; do printf '  make %-8s %s\n' "$$t" "$$d"; done

setup: ## install what is missing and build; a second run returns at once
	@scripts/setup.sh

build: ## rebuild what changed (colcon)
	@scripts/build.sh

demo: ## the whole promise on the lander: compile, fly, ROS 2, record, replay, look
	@scripts/setup.sh fcsl_bridge lander ahrs
	@$(ENV) python3 scripts/demo.py

test: setup ## lint, every package's tests, then those that cross packages; CHANGED=origin/main: what differs from there
	@scripts/test.sh $(CHANGED)

wheels: setup ## one wheel, out/wheels/fcsl-….whl, for any x86-64 Linux with glibc 2.28: FCSL without ROS and without this workspace
	@scripts/wheels.sh

verify: setup ## the evidence: EVA, binaries, other processors, sanitizers, fuzzers, generated programs (installs its tools); EFFORT=full goes further
	@FCSL_EFFORT=$(EFFORT) scripts/verify.sh

bench: setup ## the figures: steps, filters, simulator, replay, ROS 2 nodes, each beside what others would write; SIZE=smallest: only whether all of it runs
	@scripts/bench/harness/setup.sh
	@$(ENV) FCSL_BENCH_SIZE=$(SIZE) python3 scripts/bench

interop: setup ## FCSL beside rclpy nodes in a ROS 2 graph, through a bridge with zenoh-plugin-ros2dds, which it builds once; DURATION=600 s
	@scripts/interop/build.sh
	@$(ENV) python3 scripts/interop $(DURATION)

hardware: setup ## a Linux kernel with real drivers and chips that are registers, which it builds once: each device is tried
	@scripts/hardware/build.sh > /dev/null
	@$(ENV) python3 scripts/hardware

lint: setup ## ruff, mypy, clang-format; nothing is changed
	@. scripts/underlay.sh && ruff check $(PYTHON_DIRS)
	@. scripts/underlay.sh && ruff format --check $(PYTHON_DIRS)
	@. scripts/underlay.sh && mypy
	@. scripts/underlay.sh && clang-format --dry-run -Werror $(C_FILES)

format: setup ## let ruff and clang-format rewrite the sources
	@. scripts/underlay.sh && ruff check --fix $(PYTHON_DIRS)
	@. scripts/underlay.sh && ruff format $(PYTHON_DIRS)
	@. scripts/underlay.sh && clang-format -i $(C_FILES)

clean: ## remove what was built (the environment in .venv stays)
	@rm -rf build install log out
