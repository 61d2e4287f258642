# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# The front door: each target does one everyday thing from a fresh clone on. What it runs is plain CMake and the scripts
# of tools/; nothing is built here that `cmake --preset` could not build.
.DEFAULT_GOAL := help
.PHONY: help demo test seeds bench instructions lint format asan tsan coverage mutate fuzz chaos ros reference install deb site clean
PREFIX ?= /usr/local

# ThreadSanitizer of older compilers cannot start where a kernel randomises much of the address space
# (vm.mmap_rnd_bits > 28): run it without, where that is permitted.
NO_RANDOMISATION := $(shell setarch -R true 2>/dev/null && echo setarch -R)

help: ## this list
	@grep -E '^[a-z]+: .*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+): .*## (.*)/  make \1\t\2/' | expand -t 18

demo: ## build the program, compare the executors on one workload, and make results/demo/report.html of it
	@tools/bootstrap run
	cmake --preset release
	cmake --build --preset release
	build/release/bin/redag compare workloads/contention.yaml --executors redag,mte,ste --repeat 3 --duration 3s \
	  --out results/demo
	build/release/bin/redag report results/demo

test: ## build everything and run all tests
	@tools/bootstrap test
	cmake --preset test
	cmake --build --preset test
	ctest --preset test

SEEDS ?= 10
seeds: test ## run the tests of random cases SEEDS (10) times, each time with a new seed; make test always has the same one
	@for i in $$(seq $(SEEDS)); do \
	  seed=$$(od -An -N4 -tu4 /dev/urandom | tr -d ' '); echo "$$i of $(SEEDS): RC_PARAMS=seed=$$seed"; \
	  RC_PARAMS="seed=$$seed" ctest --preset test --progress -L '^(base|executors|metrics|model|runtime|testing|workload|model_check)$$' || exit; \
	done

BENCH_ROUNDS ?= 7
bench: ## build the benchmarks, run them BENCH_ROUNDS (7) times, print ratios; JSON goes to results/bench/
	@tools/bootstrap bench
	cmake --preset bench
	cmake --build --preset bench
	tools/bench --rounds $(BENCH_ROUNDS)

instructions: ## instructions of a job in scheduler and engine, counted by valgrind; fails 3 % above tests/budgets
	@tools/bootstrap instructions
	cmake --preset bench
	cmake --build --preset bench --target redag_counted
	tools/count_instructions

lint: ## layers, references, commits, module diagram, formatting, locks, and clang-tidy on files that differ from the main branch
	@tools/bootstrap lint
	tools/check_layers
	tools/check_size
	tools/check_prose
	tools/check_spdx
	tools/check_references
	tools/check_commits
	tools/module_diagram --check
	tools/format --check
	cmake --preset dev
	tools/check_sources
	tools/tidy

format: ## rewrite all C++ files as .clang-format says
	@tools/bootstrap lint
	tools/format

asan: ## all tests under AddressSanitizer and UndefinedBehaviorSanitizer
	@tools/bootstrap test
	cmake --preset asan-ubsan
	cmake --build --preset asan-ubsan
	ctest --preset asan-ubsan

tsan: ## the tests of what has threads, and chaos, under ThreadSanitizer
	@tools/bootstrap test
	cmake --preset tsan
	$(NO_RANDOMISATION) cmake --build --preset tsan
	$(NO_RANDOMISATION) ctest --preset tsan

coverage: ## lines and branches of the sources that the tests run; a page in results/coverage/
	@tools/bootstrap coverage
	cmake --preset coverage
	cmake --build --preset coverage
	find build/coverage -name '*.gcda' -delete
	ctest --preset coverage
	@mkdir -p results/coverage
	gcovr --config tools/gcovr.cfg --html-details results/coverage/index.html --json-summary results/coverage/summary.json \
	  build/coverage

mutate: ## break the sources on purpose, as tests/mutations.yaml says, and see whether the tests notice
	@tools/bootstrap test
	tools/mutate

FUZZ_SECONDS ?= 600
fuzz: ## look for input that breaks a reader: FUZZ_SECONDS (600) of processor time for each target of tests/fuzz
	@tools/bootstrap fuzz
	cmake --preset fuzz
	cmake --build --preset fuzz
	tools/fuzz $(FUZZ_SECONDS)

CHAOS_RUNS ?= 2000
chaos: ## faults by the thousand: CHAOS_RUNS (2000) runs of executor and simulator, a hundredth of it of each fault from outside
	@tools/bootstrap test
	cmake --preset test
	cmake --build --preset test --target redag_chaos redag_cli redag_allocation_failures redag_jumping_clock
	build/test/tests/chaos/redag_chaos simulator $(CHAOS_RUNS)
	build/test/tests/chaos/redag_chaos executor $(CHAOS_RUNS)
	build/test/tests/chaos/redag_allocation_failures workloads
	tests/chaos/process.py build/test/bin/redag . --runs $$(($(CHAOS_RUNS) / 100)) \
	  --clock build/test/tests/chaos/libredag_jumping_clock.so

ros: ## build the ROS packages with colcon and run their tests, for each ROS 2 under /opt/ros
	@tools/bootstrap test
	tools/test_rclcpp

reference: ## the reference of the C++ interface, by doxygen, in build/reference/html; its warnings are errors
	@tools/bootstrap reference
	tools/reference

install: ## install libraries, headers and program to PREFIX (default /usr/local)
	@tools/bootstrap run
	cmake --preset release
	cmake --build --preset release
	cmake --install build/release --prefix $(PREFIX)

PRERELEASE ?=
deb: ## Debian packages in build/package/packages; PRERELEASE=rc1 makes those of a release candidate
	@tools/bootstrap package
	rm -rf build/package/packages
	cmake --preset package -DREDAG_PRERELEASE=$(PRERELEASE)
	export SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) && cmake --build --preset package && \
	  cpack --config build/package/CPackConfig.cmake

site: ## the documentation site in results/site
	@tools/bootstrap site
	cmake --preset release
	cmake --build --preset release
	tools/build_site build/release/bin/redag results/site

clean: ## remove what the targets above built; results/ stays
	rm -rf build/dev build/test build/release build/asan-ubsan build/tsan build/coverage build/mutate build/fuzz build/package build/colcon build/reference
	git worktree prune
