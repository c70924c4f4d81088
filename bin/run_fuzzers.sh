#!/usr/bin/env bash
# Feeds damaged files to the readers of real data, under the address and
# undefined-behaviour sanitizers, and fails if one of them crashes, hangs,
# allocates much, or accepts what is inconsistent.
#
#   bin/run_fuzzers.sh               each of tests/fuzz/X_fuzz.cc for 60 s
#   bin/run_fuzzers.sh --seconds=5   for 5 s
#
# Starts from tests/fuzz/corpus/X and from what earlier runs left in
# build/fuzz/corpus/X. The input that a reader fails on is left as
# build/fuzz/X-crash-... (timeout, oom): fix the reader, then move the input to
# tests/fuzz/corpus/X, which the unit tests read as well.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

seconds=60
case "${1:-}" in
  --seconds=[1-9]*) seconds="${1#--seconds=}" ;;
  "") ;;
  *)
    echo "Unknown argument $1; expected --seconds=N" >&2
    exit 1
    ;;
esac

install_missing clang libclang-rt-dev libeigen3-dev libceres-dev \
  libgoogle-glog-dev libbz2-dev libfmt-dev

fuzz_dir="$root/build/fuzz"
mkdir -p "$fuzz_dir"
readonly fuzz_dir seconds
# Common sources of the readers: without Ceres they compile in a few seconds.
readonly sources=(
  "$root/tests/fuzz/token_mutator.cc"
  "$root"/problems/estimation/{bzip2,text_cursor}.cc
  "$root"/lib/invgrad/{core/memory_limit,core/specification,io/atomic_file}.cc
)

# Compiles the fuzzer X into build/fuzz/X.
compile() {
  local readers=("$root/problems/estimation/$1.cc")
  if [[ "$1" == g2o_file ]]; then
    readers+=("$root"/problems/estimation/{g2o_text,information}.cc
      "$root/problems/estimation/pose_graph_start.cc")
  fi
  clang++ -std=c++17 -g -O1 -Wall -Wextra -Werror \
    -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all \
    -I "$root" -I "$root/lib" -isystem /usr/include/eigen3 \
    "$root/tests/fuzz/${1}_fuzz.cc" "${readers[@]}" \
    "${sources[@]}" -lbz2 -lglog -lfmt -o "$fuzz_dir/$1"
}

# Runs the fuzzer; shows its output only if it found something.
fuzz() {
  local log="$fuzz_dir/$1.log"
  mkdir -p "$fuzz_dir/corpus/$1"
  if "$fuzz_dir/$1" -max_total_time="$seconds" -max_len=4096 -timeout=10 \
    -rss_limit_mb=1024 -malloc_limit_mb=64 -print_final_stats=1 \
    -artifact_prefix="$fuzz_dir/$1-" \
    "$fuzz_dir/corpus/$1" "$root/tests/fuzz/corpus/$1" >"$log" 2>&1
  then
    echo "$1: nothing found in $(awk '/executed_units/ {print $2}' "$log") inputs"
  else
    tail -n 60 "$log" >&2
    echo "$1: FAILED; see $log and the input that it names" >&2
    return 1
  fi
}

compile_and_fuzz() { compile "$1" && fuzz "$1"; }

# All at once, for any number of cores: each has a time limit by the clock.
running=()
failed=0
for source in "$root"/tests/fuzz/*_fuzz.cc; do
  compile_and_fuzz "$(basename -- "$source" _fuzz.cc)" &
  running+=($!)
done
for job in "${running[@]}"; do
  wait "$job" || failed=1
done
exit "$failed"
