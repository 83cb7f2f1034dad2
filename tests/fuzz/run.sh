#!/bin/sh
# Fuzzes the native code with libFuzzer, AddressSanitizer and UBSan: run.sh [seconds a target].
# Needs clang. A crash leaves its input in build/fuzz and a status that is not 0.
set -eu
cd "$(dirname "$0")/../.."
seconds="${1:-300}"
mkdir -p build/fuzz
for target in decoder kernel; do
  corpus="build/fuzz/$target.corpus"
  mkdir -p "$corpus"
  "${CLANGXX:-clang++}" -std=c++20 -O1 -g -fsanitize=fuzzer,address,undefined \
    -fno-sanitize-recover=all -I runtime/native "tests/fuzz/$target.cpp" -o "build/fuzz/$target"
  "build/fuzz/$target" -max_total_time="$seconds" -max_len=8192 -timeout=10 -print_final_stats=1 \
    -verbosity=0 -artifact_prefix="build/fuzz/" "$corpus"
done
