#!/bin/sh
# Fuzzes the native code with libFuzzer, AddressSanitizer and UBSan, then a whole boat by messages
# made with a grammar (messages.py):
#   run.sh [seconds a target] [--skip-without-clang]
# FUZZ_TARGETS names the targets, if not all.
# Needs clang, which is installed by apt if it is missing, or with the flag nothing is done then.
# A crash leaves its input in build/fuzz and a status that is not 0.
set -eu
cd "$(dirname "$0")/../.."
seconds="${1:-300}"
case " ${FUZZ_TARGETS:-messages} " in
  *" messages "*) .venv/bin/python tests/fuzz/messages.py "$seconds" ;;
esac
clang="${CLANGXX:-clang++}"
if ! command -v "$clang" >/dev/null; then
  if [ "${2:-}" = "--skip-without-clang" ]; then
    echo "fuzz: SKIPPED, there is no $clang (apt install clang)"
    exit 0
  fi
  echo "fuzz: there is no $clang; installing clang by apt"
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo"
  if ! { $as_root apt-get install -qq -y clang >/dev/null && command -v "$clang" >/dev/null; }; then
    echo "fuzz: clang could not be installed: install it, or set CLANGXX to a clang++" >&2
    exit 1
  fi
fi
mkdir -p build/fuzz
for target in ${FUZZ_TARGETS:-decoder kernel shift tracking assurance}; do
  [ "$target" != messages ] || continue
  corpus="build/fuzz/$target.corpus"
  mkdir -p "$corpus"
  "$clang" -std=c++20 -O1 -g -Wall -Wextra -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all \
    -I runtime/native "tests/fuzz/$target.cpp" -o "build/fuzz/$target"
  "build/fuzz/$target" -max_total_time="$seconds" -max_len=8192 -timeout=10 -print_final_stats=1 \
    -verbosity=0 -artifact_prefix="build/fuzz/" "$corpus"
done
echo "fuzz: clean, $seconds s for each target"
