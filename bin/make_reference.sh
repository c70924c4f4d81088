#!/usr/bin/env bash
# Makes the API reference from the headers: build/docs/html/index.html. Installs
# Doxygen if it is missing. Its warnings are errors.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

install_missing doxygen
cd "$root"
INVGRAD_VERSION=$(awk '/^#define INVGRAD_VERSION_[A-Z]+ / {
  printf "%s%s", separator, $3; separator = "." }' lib/invgrad/version.h)
export INVGRAD_VERSION
mkdir -p build/docs
doxygen docs/reference/Doxyfile
echo "build/docs/html/index.html"
