# Sourced by environment.sh and by tests that copy the scripts; needs ROOT.

# What the installation depends on; a change of it installs again.
fingerprint() {
    (cd "$ROOT" && cat pyproject.toml scripts/requirements.lock scripts/generate_types.py \
        lcmtypes/*.lcm | cksum)
    printf '%s\n' "$ROOT"
}
