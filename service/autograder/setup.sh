#!/usr/bin/env bash
# Gradescope runs this once, as root, when it builds the image. Robomark comes from a wheel beside this file, if there
# is one, else from the package index of the image.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
apt-get update
apt-get install -y --no-install-recommends python3.11 python3.11-venv
python3.11 -m venv "$here/../venv"
wheel="$(find "$here" -maxdepth 1 -name 'robomark-*.whl' | head -n 1)"
"$here/../venv/bin/pip" install "${wheel:-robomark==VERSION}"
"$here/../venv/bin/robomark" sandbox check || echo "Here no student code can be run: see docs/sandbox.md." >&2
