# Sourced by the other scripts: makes .venv in the repository and enters it.
# Sets ROOT to the repository.

set -euo pipefail
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

. "$ROOT/scripts/installation.sh"

make_environment() {
    local python stamp="$ROOT/.venv/.installed"
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint)" ]; then
        return
    fi
    python=$(find_python)
    if [ ! -x "$ROOT/.venv/bin/python" ]; then
        rm -rf "$ROOT/.venv"
        if ! "$python" -m venv "$ROOT/.venv" >&2; then
            rm -rf "$ROOT/.venv"
            fail "$python cannot make a virtual environment (its venv or ensurepip module is missing)." \
                "On Debian or Ubuntu: sudo apt install python3-venv"
        fi
    fi
    echo "Installing into .venv ..." >&2
    # Every file that is installed is one of those whose hashes ./scripts/lock wrote down; what
    # builds the package is among them, so nothing else is fetched for the build.
    local install=("$ROOT/.venv/bin/python" -m pip install --quiet --disable-pip-version-check)
    if ! "${install[@]}" --require-hashes --requirement "$ROOT/scripts/requirements.lock" >&2 ||
        ! "${install[@]}" --no-deps --no-build-isolation --editable "$ROOT" >&2; then
        fail "Installing the packages failed; the reason stands above." \
            "Most often there is no connection to the package index, or a proxy must be set." \
            "Where it says that hashes do not match, the index gives other files than those that" \
            "were tested: do not install them, or choose and test anew with ./scripts/lock."
    fi
    fingerprint > "$stamp"
}

make_environment
export PATH="$ROOT/.venv/bin:$PATH"
export VIRTUAL_ENV="$ROOT/.venv"
