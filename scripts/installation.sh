# Sourced by environment.sh, by lock and by tests that copy the scripts; needs ROOT.

# What the installation depends on; a change of it installs again.
fingerprint() {
    (cd "$ROOT" && cat pyproject.toml scripts/requirements.lock scripts/generate_types.py \
        lcmtypes/*.lcm | cksum)
    printf '%s\n' "$ROOT"
}

fail() {
    printf '%s\n' "$@" >&2
    exit 2
}

find_python() {
    local candidate
    for candidate in python3 python3.14 python3.13 python3.12 python3.11 python3.10; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
            printf '%s\n' "$candidate"
            return
        fi
    done
    fail "Python 3.10 or newer is missing." "On Debian or Ubuntu: sudo apt install python3 python3-venv"
}
