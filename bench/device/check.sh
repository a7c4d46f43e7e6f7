#!/usr/bin/env bash
# Builds, tests and measures the CUDA executor on a machine with a GPU. Needs no network: a C++
# compiler, nvcc, cmake and ninja have to be there; what else is there is used (a Python with its headers,
# numpy, scipy, pybind11; mujoco; GoogleTest; ...), and what is left out is said. What fails or hangs
# takes nothing else with it.
#
#   bench/device/check.sh [--dry] [build] [test] [sanitize] [bench] [peers]      default: all of them
#
# --dry goes through the same without a GPU, as far as that is possible: CUDA is compiled and linked, and
# the tests and the Python programs run, small, on the emulated runtime (tests/cpp/cuda/emulation). Its
# times mean nothing and go to the build tree.
#
#   OUT      where the results go (bench/results)
#   BUILD    build tree (build/device)
#   PYTHON   (python3)
#   SECONDS_EACH   of one measurement (0.3)
#   LIMIT    seconds that a program may take (600)
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
OUT=${OUT:-bench/results}
BUILD=${BUILD:-build/device}
PYTHON=${PYTHON:-python3}
EACH=${SECONDS_EACH:-0.3}
LIMIT=${LIMIT:-600}
export PATH=$PATH:/usr/local/cuda/bin
dry=
if [[ ${1:-} == --dry ]]; then
  dry=1
  shift
fi
parts=${*:-build test sanitize bench peers}
for part in $parts; do
  case $part in
    build | test | sanitize | bench | peers) ;;
    *)
      echo "error: there is no part '$part'; $0 [--dry] [build] [test] [sanitize] [bench] [peers]" >&2
      exit 2
      ;;
  esac
done
mkdir -p "$OUT" "$BUILD"
OUT=$(cd "$OUT" && pwd) BUILD=$(cd "$BUILD" && pwd)
[[ -z $dry ]] || OUT=$BUILD
ROWS=$OUT/device.jsonl  # as they come; gone when all of them are in device.json
failed=() left_out=()

wanted() { [[ " $parts " == *" $1 "* ]]; }
title() { printf '\n== %s\n' "$*"; }
# try NAME COMMAND...: runs it, and remembers NAME if it fails.
try() {
  local name=$1
  shift
  title "$name"
  "$@" || failed+=("$name")
}
skip() {
  echo "left out: $*"
  left_out+=("$*")
}
has_module() { "$PYTHON" -c "import $1" 2>/dev/null; }
has_header() { echo "#include <$1>" | "${CXX:-c++}" -std=c++20 -E -x c++ "${@:2}" - >/dev/null 2>&1; }
limited() { timeout "$LIMIT" "$@"; }

[[ -z $dry ]] || skip "times that mean anything: those of a dry run are of an emulated device"

title "machine"
date -u +%Y-%m-%dT%H:%M:%SZ
nvidia-smi --query-gpu=name,driver_version,memory.total,clocks.max.sm --format=csv,noheader || true
lscpu 2>/dev/null | grep -E '^(Model name|CPU\(s\)|Thread|L2|L3)' || true
nvcc --version | tail -2
"${CXX:-c++}" --version | head -1

# can_extend: whether Python extensions can be built here.
can_extend() {
  has_module numpy && has_module pybind11 &&
    has_header Python.h -I"$("$PYTHON" -c 'import sysconfig; print(sysconfig.get_path("include"))')"
}
# Warnings are errors in a dry run only: another compiler's new ones are no reason to measure nothing.
configure() {
  local python=(-DTRAJOPT_PYTHON=OFF)
  if [[ $extension == ON ]]; then
    python=(-DTRAJOPT_PYTHON=ON -DPython_EXECUTABLE="$(command -v "$PYTHON")"
      -Dpybind11_DIR="$("$PYTHON" -m pybind11 --cmakedir)")
  fi
  cmake -S . -B "$BUILD" -G Ninja -DCMAKE_BUILD_TYPE=Release -DTRAJOPT_CUDA=ON \
    -DTRAJOPT_WERROR="${dry:+ON}" -DCMAKE_CUDA_ARCHITECTURES="${CUDAARCHS:-$architectures}" \
    -DTRAJOPT_TESTS="$tests" -DTRAJOPT_DEVICE_TESTS="$device_tests" -DTRAJOPT_DEVICE_BENCH=ON \
    "${python[@]}"
}
build() {
  local tests=ON extension=ON device_tests=ON core=python/bindings architectures
  architectures=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null |
    tr -dc '0-9\n' | sort -u | paste -sd ';')
  architectures=${architectures:-native}
  has_header gtest/gtest.h || tests=OFF
  can_extend || extension=OFF
  if [[ -n $dry ]]; then
    architectures=90 device_tests=OFF core=emulated
  fi
  rm -rf "$BUILD"/stage "$BUILD"/device "$BUILD/$core"/_core*.so  # what is not built is not run
  # What is half there, like a header without its library, is done without.
  until configure; do
    rm -f "$BUILD/CMakeCache.txt"
    if [[ $extension == ON ]]; then
      extension=OFF
    elif [[ $tests == ON ]]; then
      tests=OFF
    else
      return 1
    fi
    title "build: once more, Python $extension, GoogleTest $tests"
  done
  # As much as can be built, whatever cannot.
  local status=0
  cmake --build "$BUILD" -- -k 0 || status=1
  if [[ -n $dry && $tests == ON && $extension == ON ]]; then
    cmake --build "$BUILD" --target emulated_core || status=1
  fi
  if compgen -G "$BUILD/$core/_core*.so" >/dev/null; then
    mkdir -p "$BUILD/stage" && cp -r python/trajopt "$BUILD/stage/" &&
      rm -f "$BUILD"/stage/trajopt/_core*.so &&
      cp "$BUILD/$core"/_core*.so "$BUILD/stage/trajopt/" || status=1
  fi
  return $status
}
export PYTHONPATH=$BUILD/stage${PYTHONPATH:+:$PYTHONPATH}

if wanted build; then
  try "build" build
  compgen -G "$BUILD/device/*_device" >/dev/null || { echo "nothing to run"; exit 1; }
fi

# Programs in Python need the package that was built; an editable installation would come first,
# whatever the path says.
package=
if wanted test || wanted bench; then
  if [[ -d $BUILD/stage ]]; then
    found=$("$PYTHON" -c 'from trajopt import _core; print(_core.__file__)')
    if [[ $found == "$BUILD"/stage/* ]]; then
      package=1
    else
      echo "error: $PYTHON imports trajopt from ${found:-nowhere}, not what was built in" \
        "$BUILD/stage; set PYTHON to one with numpy and scipy and without an installed trajopt"
      failed+=("import trajopt")
    fi
  fi
  [[ -n $package ]] || skip "all Python programs: no package was built for $PYTHON"
fi

if wanted test; then
  # Every *_device program compares bits with the processor when asked to `check`.
  if [[ -n $dry ]]; then
    skip "the checks of $(basename -a "$BUILD"/device/*_device | xargs): no GPU in a dry run"
  else
    for program in "$BUILD"/device/*_device; do
      try "$(basename "$program") check" limited "$program" check
    done
  fi
  if [[ -f $BUILD/tests/cpp/CTestTestfile.cmake ]]; then
    try "ctest: GPU tests" ctest --test-dir "$BUILD" --output-on-failure --no-tests=error \
      --timeout "$LIMIT" -R "^${dry:+(emulated_)?}cuda\."
  else
    skip "the C++ GPU tests: no GoogleTest here"
  fi
  if [[ -z $package ]]; then
    :
  elif has_module pytest; then
    tests=tests/python/cuda
    [[ -z $dry ]] || tests=$tests/test_cuda_batch.py  # what an emulated device does in a minute
    if ! has_module mujoco; then  # reads the built-in characters
      skip "the Python GPU tests but those of the linear algebra: need mujoco (a wheel)"
      tests=tests/python/cuda/test_cuda_linalg.py
    fi
    has_module casadi || skip "the Python GPU tests of users' residuals: need casadi (a wheel)"
    try "pytest: GPU tests" limited "$PYTHON" -m pytest -m cuda -p no:cacheprovider $tests
  else
    skip "the Python GPU tests: no pytest here"
  fi
fi

if wanted sanitize; then
  if [[ -n $dry ]]; then
    skip "compute-sanitizer: no GPU in a dry run"
  elif command -v compute-sanitizer >/dev/null; then
    # The linear algebra's own checks, and the solver's batches where GoogleTest is there.
    for program in "$BUILD"/device/*_device "$BUILD"/tests/cpp/cuda_device_batch_test; do
      [[ -x $program ]] || { skip "compute-sanitizer on $(basename "$program"): not built"; continue; }
      argument=check
      [[ $program == *_test ]] && argument=--gtest_brief=1
      for tool in memcheck racecheck synccheck initcheck; do
        title "compute-sanitizer $tool, $(basename "$program")"
        limited compute-sanitizer --tool $tool --error-exitcode 9 "$program" $argument \
          >"$BUILD/sanitizer.log" 2>&1
        status=$?
        tail -3 "$BUILD/sanitizer.log"
        if grep -q "Device not supported" "$BUILD/sanitizer.log"; then
          skip "compute-sanitizer: it does not support this device or its container"
          break 2
        elif ((status == 124)); then
          skip "compute-sanitizer $tool on $(basename "$program"): not done in $LIMIT seconds"
        elif ((status != 0)); then
          failed+=("compute-sanitizer $tool $(basename "$program")")
        fi
      done
    done
  else
    skip "compute-sanitizer: not here"
  fi
fi

# Each program prints one JSON object a line.
measure() {
  local name=$1
  shift
  title "$name"
  limited "$@" | tee -a "$ROWS" || failed+=("$name")
}
if wanted bench || wanted peers; then : >"$ROWS"; fi
if wanted bench; then
  small=
  for program in "$BUILD"/device/*_device; do
    if [[ -n $dry ]]; then
      small=--small
      skip "$(basename "$program") bench: no GPU in a dry run"
      continue
    fi
    measure "$(basename "$program")" "$program" bench "$EACH"
  done
  for program in bench/device/*_device.py; do
    if [[ -z $package ]]; then
      continue
    elif has_module mujoco; then  # reads the built-in characters
      measure "$(basename "$program")" "$PYTHON" "$program" "$EACH" $small
    else
      skip "$(basename "$program"): needs mujoco (a wheel)"
    fi
  done
fi
if wanted peers && [[ -n $dry ]]; then
  skip "the peers: no GPU in a dry run"
elif wanted peers; then
  if [[ -x $BUILD/device/peer_cusolver ]]; then
    measure "cuSOLVER and cuBLAS" "$BUILD/device/peer_cusolver" "$EACH"
  else
    skip "cuSOLVER and cuBLAS: not part of this CUDA toolkit"
  fi
  if [[ -x $BUILD/device/peer_cudss ]]; then
    measure "cuDSS" "$BUILD/device/peer_cudss" "$EACH"
  else
    skip "cuDSS: not here (CUDSS_ROOT names the folder of its include and lib)"
  fi
  if has_module socu; then
    measure "socu" "$PYTHON" bench/device/peer_socu.py "$EACH"
  else
    skip "socu: not importable here (wheels: socu, warp-lang)"
  fi
fi
if wanted bench || wanted peers; then
  try "table" "$PYTHON" bench/device/collect.py "$ROWS" "$OUT/device.json" "${left_out[@]}"
  [[ ! -e $OUT/device.json ]] || [[ $OUT/device.json -ot $ROWS ]] || rm -f "$ROWS"
fi

title "result"
for what in "${left_out[@]}"; do echo "left out: $what"; done
if ((${#failed[@]})); then
  printf 'failed: %s\n' "${failed[@]}"
  exit 1
fi
echo "all good"
