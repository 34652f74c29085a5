# Sourced, never run: the whole environment of this workspace. bash or zsh; safe under `set -u`.
#   . scripts/env.sh
. "$(dirname "${BASH_SOURCE[0]:-$0}")/underlay.sh"
case $- in *u*) _fcsl_nounset=-u ;; *) _fcsl_nounset=+u ;; esac
set +u
if [ -f "$_fcsl_root/install/local_setup.bash" ]; then
    if [ -n "${ZSH_VERSION:-}" ]; then . "$_fcsl_root/install/local_setup.zsh"; else . "$_fcsl_root/install/local_setup.bash"; fi
else
    echo "fcsl: nothing built in $_fcsl_root/install yet; run 'make build'" >&2
fi
set $_fcsl_nounset
unset _fcsl_nounset _fcsl_root
