#!/usr/bin/env bash
# Times `make demo` in a fresh clone of this checkout with an empty cache of kernels, as a newcomer runs it.
#
#     tools/demo_time.sh      # on an idle machine; twice if pip's cache was empty
#
# Prints the seconds of the installation, of the first compilation of kernels, and of the rest. The clone holds what is
# committed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
git clone --quiet "$(git -C "$(dirname "$0")" rev-parse --show-toplevel)" "$folder/armwright"
cat > "$folder/sitecustomize.py" << 'PYTHON'
import atexit
import os
import sys


def add_seconds():
    if devices := sys.modules.get("armwright.kinematics.devices"):
        with open(os.environ["KERNEL_SECONDS"], "a", encoding="utf-8") as file:
            print(devices.compilation.seconds, file=file)


atexit.register(add_seconds)
PYTHON
export KERNEL_SECONDS="$folder/seconds" WARP_CACHE_PATH="$folder/kernels"
cd "$folder/armwright"

now() { date +%s.%N; }
started=$(now)
make .venv/.run
installed=$(now)
PYTHONPATH="$folder" make demo
awk -v started="$started" -v installed="$installed" -v ended="$(now)" '
    { kernels += $1 }
    END {
        install = installed - started; rest = ended - installed - kernels
        printf "install %.0f s, kernels %.0f s, rest %.0f s; ", install, kernels, rest
        printf "install and rest %.0f s, all %.0f s\n", install + rest, install + kernels + rest
    }' "$KERNEL_SECONDS"
