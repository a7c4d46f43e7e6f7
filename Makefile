# Everything runs inside .venv; cmake and ninja come with it, so only Python >= 3.10 with its headers
# and venv, a C++20 compiler and make must be there before.
#
#   make demo    solve the built-in hop; write the motion and its pictures under out/
#   make test    C++ tests (ctest) and Python tests (pytest)
#   make lint    ruff, mypy, clang-format, docs
#   make docs    the documentation as a web site, under build/site
#   make format  let ruff and clang-format rewrite the files
#   make bench   benchmarks of the core
#   make asan    C++ tests under the address and undefined-behaviour sanitizers; `make tsan` for races
#   make clean   remove build trees and results; `make distclean` removes .venv too

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
PIP := $(BIN)/python -m pip install --quiet

CPP_FILES = $(shell find cpp python/bindings tests/cpp bench cuda -name '*.h' -o -name '*.cpp' \
                    -o -name '*.cu' -o -name '*.cuh' 2>/dev/null)

.PHONY: demo test test-cpp test-python lint lint-python lint-types lint-cpp docs format tidy asan tsan bench \
        clean distclean install
.DELETE_ON_ERROR:

# --- environment ---------------------------------------------------------------------------------

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
	  || { echo "error: $(PYTHON) is older than 3.10; try make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null \
	  || { echo "error: $(PYTHON) has no venv; on Debian: apt-get install python3-venv"; exit 1; }
	@command -v $(firstword $(CXX)) >/dev/null \
	  || { echo "error: no C++ compiler; on Debian: apt-get install g++"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# Build tools live in .venv, so that rebuilding after an edit recompiles only what changed.
$(VENV)/build-tools: pyproject.toml | $(BIN)/python
	@CPATH=$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("include"))') \
	  .ci/native-dependency Python.h python3-dev
	$(PIP) 'scikit-build-core>=0.11' 'pybind11>=2.12' 'cmake>=3.20' ninja
	@touch $@

$(VENV)/extra-%: $(VENV)/build-tools
	$(PIP) --no-build-isolation -e '.[$*]'
	@touch $@

install: $(VENV)/build-tools
	$(PIP) --no-build-isolation --no-deps -e .

# --- the two commands ----------------------------------------------------------------------------

demo: $(VENV)/extra-plot install
	@mkdir -p out
	$(BIN)/trajopt solve hop --out out/hop.npz
	$(BIN)/trajopt plot out/hop.npz -o out/hop-motion.png --only motion --only forces
	$(BIN)/trajopt plot out/hop.npz -o out/hop-convergence.png --only convergence

test: test-cpp test-python

test-cpp: $(VENV)/build-tools
	@.ci/native-dependency gtest/gtest.h libgtest-dev
	cmake --preset cpu
	cmake --build --preset cpu
	ctest --preset cpu

test-python: $(VENV)/extra-test install
	$(BIN)/python -m pytest

# --- quality -------------------------------------------------------------------------------------

lint: lint-python lint-types lint-cpp docs

lint-python: $(VENV)/extra-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

lint-types: $(VENV)/extra-dev install
	$(BIN)/mypy

lint-cpp: $(VENV)/extra-dev
	$(BIN)/clang-format --dry-run -Werror $(CPP_FILES)

# A page that is in no menu and a link that leads nowhere are errors.
docs: $(VENV)/extra-dev
	$(BIN)/mkdocs build --quiet --strict --site-dir build/site

format: $(VENV)/extra-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(CPP_FILES)

# Kernels once for every instruction set; bindings without those that need CUDA.
tidy: $(VENV)/extra-dev
	cmake --preset cpu -DTRAJOPT_PYTHON=ON -Dpybind11_DIR=$$($(BIN)/python -m pybind11 --cmakedir)
	$(BIN)/clang-tidy -p build/cpu --quiet \
	  $(filter-out %/cuda_linalg.cpp,$(filter cpp/%.cpp python/bindings/%.cpp,$(CPP_FILES)))

# Memory, undefined behaviour and races in the C++ tests. Slow: a quarter of an hour each.
asan: $(VENV)/build-tools
	@.ci/native-dependency gtest/gtest.h libgtest-dev
	cmake --preset asan
	cmake --build --preset asan
	ctest --preset asan

# OpenMP's barriers are known to the sanitizer by Archer, which comes with LLVM's runtime.
LLVM_LIBRARIES = $(abspath $(dir $(realpath $(shell command -v clang++)))../lib)

tsan: $(VENV)/build-tools
	@.ci/native-dependency gtest/gtest.h libgtest-dev
	@test -e "$(LLVM_LIBRARIES)/libarcher.so" \
	  || { echo "error: no clang++ with OpenMP; on Debian: apt-get install clang libomp-dev"; exit 1; }
	cmake --preset tsan
	cmake --build --preset tsan
	OMP_TOOL_LIBRARIES=$(LLVM_LIBRARIES)/libarcher.so ctest --preset tsan

bench: $(VENV)/build-tools
	@.ci/native-dependency benchmark/benchmark.h libbenchmark-dev
	cmake --preset bench
	cmake --build --preset bench
	@set -e; for program in $$(find build/bench/bench -maxdepth 1 -type f -perm -u+x); do \
	  $$program; done

clean:
	rm -rf build out .pytest_cache .mypy_cache .ruff_cache .hypothesis

distclean: clean
	rm -rf $(VENV)
