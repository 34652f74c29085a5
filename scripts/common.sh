# Sourced by the other scripts: the workspace's root, messages, progress.
root=$(pwd -P)
# Builds, tests and checks start thousands of Python processes: each file is compiled once, not by each of them.
unset PYTHONDONTWRITEBYTECODE

say() { printf 'fcsl: %s\n' "$*"; }
die() {
    printf 'fcsl: error: %s\n' "$*" >&2
    exit 1
}

# progress LABEL COMMAND...: runs it with its output in a file, says every 5 s where it is, shows the end if it fails.
# The command stays in the foreground: as a background job of a script it would ignore Ctrl-C and go on by itself.
progress() {
    local label=$1 log start=$SECONDS ticker status=0
    shift
    mkdir -p log
    log="log/$(printf '%s' "$label" | tr -cs 'A-Za-z0-9' '-').txt"
    say "$label ..."
    : > "$log"
    (while sleep 5 > /dev/null 2>&1 && kill -0 $$ 2> /dev/null; do
        printf '      %3d s  %.90s\n' $((SECONDS - start)) "$(grep -a . "$log" | tail -n 1)"
    done) &
    ticker=$!
    "$@" > "$log" 2>&1 < /dev/null || status=$?
    kill "$ticker" 2> /dev/null || true
    wait "$ticker" 2> /dev/null || true
    if [ "$status" != 0 ]; then
        tail -n 40 "$log" >&2
        die "$label failed (exit status $status); everything it printed is in $log"
    fi
    say "$label: done in $((SECONDS - start)) s"
}

# python_packages LABEL OPTION...: installs what is missing of the groups of pyproject.toml that the options of `uv pip install`
# name, as constraints.txt pins it. Into .venv, or where --target says.
python_packages() {
    local label=$1 install
    shift
    install=("$root/.venv/bin/uv" pip install --python "$root/.venv/bin/python" -c constraints.txt "$@")
    if "${install[@]}" --quiet --offline 2> /dev/null; then return; fi
    # uv reads none of pip's settings; who has a mirror or certificates of their own told pip.
    local index=${PIP_INDEX_URL:-$("$root/.venv/bin/python" -m pip config get global.index-url 2> /dev/null || true)}
    if [ -n "$index" ]; then export UV_DEFAULT_INDEX="${UV_DEFAULT_INDEX:-$index}"; fi
    if [ -n "${PIP_CERT:-}" ]; then export SSL_CERT_FILE="${SSL_CERT_FILE:-$PIP_CERT}"; fi
    progress "$label" "${install[@]}"
}

# requirements PYTHON: what pyproject.toml and constraints.txt say of the Python packages; no comments, no settings of tools.
requirements() {
    "$1" -c 'import json, tomllib; print(json.dumps(tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"]))'
    sed 's/[[:space:]]*#.*//; /^$/d' constraints.txt
}

# built_of [PACKAGE ...]: the packages that a build was asked for, and the names of all Python files that an installation links.
built_of() {
    echo "$*"
    find fcsl_* examples -name '*.py' ! -path '*/test/*' | sort | sha256sum
}

# heartbeat FOLDER: in the background, every 10 s the last line of the newest log in FOLDER; ends with the script.
heartbeat() {
    local last
    while sleep 10 > /dev/null 2>&1 && kill -0 $$ 2> /dev/null; do
        last=$(ls -t "$1"/*/stdout_stderr.log 2> /dev/null | head -n 1) || true
        printf '      %3d s  %.90s\n' "$SECONDS" "$(grep -a . "${last:-/dev/null}" | tail -n 1)"
    done
}
