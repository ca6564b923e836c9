# SPDX-License-Identifier: Apache-2.0
# Steps of tools/demo, tools/test and tools/benchmark: each prints one line with its duration, logs its
# output, and shows the end of the log and the command if it fails. Sourced, not run.
# Expects `root` (the checkout) and `log_folder` to be set.

PATH=$PATH:/usr/sbin:/sbin # for `ip`, which Debian keeps off the PATH of ordinary users

say() { printf '%s\n' "$*"; }
fail() {
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit 1
}

seconds_since() { awk -v a="$1" -v b="$(date +%s.%N)" 'BEGIN { printf "%.1f", b - a }'; }

# step NAME COMMAND [ARGUMENT ...]: runs the command, whose output goes to a log named after NAME.
# Returns the command's status and sets `step_log` to the log.
step() {
  local name=$1 began status=0
  shift
  mkdir -p "$log_folder"
  step_log=$log_folder/$(printf '%s' "$name" | tr -cs 'A-Za-z0-9.+' '-').log
  began=$(date +%s.%N)
  printf '%-48s' "$name"
  "$@" >"$step_log" 2>&1 </dev/null || status=$?
  if [ "$status" -eq 0 ]; then
    printf ' %7s s\n' "$(seconds_since "$began")"
  else
    printf ' %7s s  FAILED (status %s)\n' "$(seconds_since "$began")" "$status"
    say "    command: $*"
    say "    the end of $step_log:"
    tail -n 40 "$step_log" | sed 's/^/    | /'
  fi
  return "$status"
}

# packages_for PURPOSE ...: package names from tools/packages.
packages_for() {
  local purpose
  for purpose in "$@"; do
    awk -v purpose="$purpose" '$1 == purpose { print $2 }' "$root/tools/packages"
  done
}

# as_root COMMAND ...: directly for root, otherwise with sudo, which asks for a password only on a
# terminal.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif [ -t 2 ] && [ -r /dev/tty ]; then
    sudo "$@" </dev/tty
  else
    sudo -n "$@"
  fi
}

apt_install() {
  as_root env DEBIAN_FRONTEND=noninteractive apt-get update -q &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "$@"
}

# install_packages PURPOSE ...: installs missing packages, if any.
install_packages() {
  local package missing=()
  command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
    fail "this is not Debian (no apt-get); install the equivalents of tools/packages," \
      "then build with 'cmake --preset release && cmake --build --preset release'"
  while read -r package; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
      missing+=("$package")
  done < <(packages_for "$@")
  if [ ${#missing[@]} -eq 0 ]; then
    say "Debian packages: all installed"
    return
  fi
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null ||
      fail "installation requires root or sudo: apt-get install ${missing[*]}"
    # Ask for a password here, since the output of steps is logged.
    if [ -t 2 ]; then sudo -v || fail "sudo refused"; fi
  fi
  step "install ${#missing[@]} Debian packages" apt_install "${missing[@]}" || exit 1
}
