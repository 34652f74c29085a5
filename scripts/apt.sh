# Sourced behind common.sh: packages of the distribution.

may_install() { type -P apt-get > /dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2> /dev/null; }; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

# Fresh lists, where we may fetch them.
package_lists() { if may_install; then progress "package lists" as_root apt-get update; fi; }

# install_packages LABEL COMMAND PACKAGE...: or says what to install before COMMAND is run again.
install_packages() {
    local label=$1 again=$2 line
    shift 2
    type -P apt-get > /dev/null || die "missing $label (Debian names): $*; install them and run $again again"
    line="apt-get install -y --no-install-recommends -o DPkg::Lock::Timeout=300 $*"
    say "$label missing; this installs them:  sudo $line"
    may_install || die "not root and no passwordless sudo: run the line above, then $again again"
    # shellcheck disable=SC2086 # a list of words
    progress "$label" as_root env DEBIAN_FRONTEND=noninteractive $line
}
