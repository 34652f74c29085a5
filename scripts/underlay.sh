# Sourced, never run: puts the tools and ROS 2 (installed or from wheels) into the environment, without this workspace's
# own packages. scripts/env.sh adds those. bash or zsh; safe under `set -u`.
_fcsl_root=$(cd "$(dirname "${BASH_SOURCE[0]:-$0}")/.." && pwd -P)
case $- in *u*) _fcsl_nounset=-u ;; *) _fcsl_nounset=+u ;; esac  # the files below read unset variables
set +u
if [ ! -f "$_fcsl_root/.venv/fcsl-underlay.sh" ]; then
    echo "fcsl: no environment in $_fcsl_root/.venv; run 'make setup' first" >&2
else
    . "$_fcsl_root/.venv/fcsl-underlay.sh"
    # Without these, the ROS wheels start every Python a second time so that it finds their libraries, which takes 25 ms.
    # scripts/ros_wheels.sh wrote the file.
    if [ -z "${_ROS_WHEELS_BOOTSTRAP_COMPLETE:-}" ] && [ -f "$VIRTUAL_ENV/local_setup.sh" ]; then
        for _fcsl_libs in "$VIRTUAL_ENV"/lib/python3*/site-packages/ros_*.libs "$VIRTUAL_ENV/lib"; do
            LD_LIBRARY_PATH="$_fcsl_libs${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
        done
        export LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
        unset _fcsl_libs
    fi
    export COLCON_DEFAULTS_FILE="$_fcsl_root/scripts/colcon.yaml"
    export ROS_LOG_DIR="${ROS_LOG_DIR:-$_fcsl_root/log/ros}"
    # DDS would otherwise multicast on every network interface.
    export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
fi
set $_fcsl_nounset
unset _fcsl_nounset
