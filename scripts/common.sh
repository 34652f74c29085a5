# Sourced by the other scripts: the workspace's root, messages, progress.
root=$(pwd -P)

say() { printf 'fcsl: %s\n' "$*"; }
die() {
    printf 'fcsl: error: %s\n' "$*" >&2
    exit 1
}

# progress LABEL COMMAND...: runs it with its output in a file, says every 5 s where it is, shows the end if it fails.
progress() {
    local label=$1 log start=$SECONDS pid status=0
    shift
    mkdir -p log
    log="log/$(printf '%s' "$label" | tr -cs 'A-Za-z0-9' '-').txt"
    say "$label ..."
    "$@" > "$log" 2>&1 < /dev/null &
    pid=$!
    while kill -0 "$pid" 2>/dev/null; do
        sleep 0.2
        if (((SECONDS - start) / 5 > ${shown:=0})); then
            shown=$(((SECONDS - start) / 5))
            printf '      %3d s  %.90s\n' $((SECONDS - start)) "$(grep -a . "$log" | tail -n 1)"
        fi
    done
    wait "$pid" || status=$?
    unset shown
    if [ "$status" != 0 ]; then
        tail -n 40 "$log" >&2
        die "$label failed (exit status $status); everything it printed is in $log"
    fi
    say "$label: done in $((SECONDS - start)) s"
}

# The names of all Python files that an installation links, as one hash.
python_sources() { find fcsl_* examples -name '*.py' ! -path '*/test/*' | sort | sha256sum; }
