#!/bin/sh
# Install lcf-edge from the archive that this file is in: nothing is asked of a network. What it leaves at
# /opt/lcf-edge/setup goes back to the version before, or removes all. DESTDIR=FOLDER: into an image.
#
#   /opt/lcf-edge-versions/VERSION   a Python environment, with the files of the system as it needs them
#   /opt/lcf-edge-versions/previous  a link to the version before
#   /opt/lcf-edge                    a link to the current one; changing versions is renaming it
set -eu
umask 022

here=$(cd "$(dirname "$0")" && pwd)
root=${DESTDIR:-}
root=${root%/}
current=$root/opt/lcf-edge
versions=$root/opt/lcf-edge-versions
previous=$versions/previous
command=$root/usr/local/bin/lcf-edge
python=${PYTHON:-python3}

usage="usage: setup [install]            the version of this archive
       setup rollback             to the version before; once more: back again
       setup remove [--purge]     leaves configuration and recordings; --purge: nothing"

say() { printf 'lcf-edge: %s\n' "$*"; }
fail() {
    printf 'lcf-edge: %s\n' "$*" >&2
    exit 1
}
# The version that a link leads to; empty: none.
linked() { if test -L "$1"; then basename "$(readlink "$1")"; fi; }
# Change a link in one step, so that a loss of power leaves the old or the new one.
link() {
    ln -sfn "$1" "$2.new"
    mv -T "$2.new" "$2"
}
# The files that a version puts into the system, without the leading slash.
files_of() { (cd "$versions/$1/system" && find etc usr -type f ! -path etc/lcf-edge/config.toml); }
runs_systemd() { test -z "$root" && test -d /run/systemd/system; }
# What ran when this began: a unit that has failed since is started anew as well.
running=
if runs_systemd; then
    running=$(systemctl list-units --plain --no-legend --state=active lcf-edge.service 'lcf-edge@*' | cut -d' ' -f1)
fi

install_version() {
    test -d "$here/wheels" || fail "$here: not an unpacked archive; run setup in one"
    version=$(cat "$here/version")
    test ! -e "$root/usr/lib/lcf-edge" ||
        fail "the Debian package is installed; first run sudo apt remove lcf-edge (it keeps configuration and recordings)"
    test -L "$current" || test ! -e "$current" ||
        fail "$current comes from make install; first run sudo make uninstall in that source (it keeps configuration and recordings)"
    machine=$(cat "$here/machine")
    test "$(uname -m)" = "$machine" || fail "this archive is for $machine and this computer is $(uname -m); take the other archive"
    found=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) ||
        fail "no $python; sudo apt install python3, or name one: PYTHON=python3.11"
    grep -qxF "$found" "$here/pythons" ||
        fail "this archive is for Python $(paste -sd ' ' "$here/pythons") and $python is $found; name another: PYTHON=python3.11"
    if test "$version" != "$(linked "$current")"; then
        build "$versions/$version"
    fi
    before=$(linked "$current")
    older=$(linked "$previous")
    activate "$version"
    if ! restart; then
        if test -z "$before" || test "$before" = "$version"; then
            fail "$version does not start; journalctl -u lcf-edge"
        fi
        activate "$before"
        rm -rf "$previous" "${versions:?}/$version"
        test -z "$older" || link "$older" "$previous"
        restart || true
        fail "$version does not start, so $before runs again; journalctl -u lcf-edge"
    fi
    for folder in "$versions"/*; do
        case $(basename "$folder") in
        "$version" | "$(linked "$previous")" | previous) ;;
        *) rm -rf "$folder" ;;
        esac
    done
    say "$version is installed${before:+; before it was $before}"
}

# A Python environment with all packages of the archive, whole or not at all.
build() {
    unfinished=$1
    rm -rf "$unfinished"
    trap 'rm -rf "$unfinished"' EXIT
    trap 'exit 1' HUP INT TERM
    mkdir -p "$versions"
    "$python" -m venv --without-pip "$1"
    pip=$(echo "$here/wheels"/pip-*.whl)
    "$1/bin/python" "$pip/pip" install --quiet --disable-pip-version-check --no-cache-dir --no-index \
        --find-links "$here/wheels" --require-hashes --no-deps -r "$here/requirements.lock"
    "$1/bin/lcf-edge" --version >/dev/null
    if test -n "$root"; then
        grep -rlIF "$root" "$1/bin" "$1/pyvenv.cfg" | xargs sed -i "s|$root/|/|g"
    fi
    cp -R "$here/system" "$here/doc" "$here/setup" "$1/"
    sync
    trap - EXIT HUP INT TERM
}

# Let a version be the current one: its files of the system, its program.
activate() {
    was=$(linked "$current")
    if test -n "$was"; then
        files_of "$was" | while read -r file; do
            test -e "$versions/$1/system/$file" || rm -f "$root/$file"
        done
    fi
    files_of "$1" | while read -r file; do
        install -D -m 644 "$versions/$1/system/$file" "$root/$file"
    done
    configuration=etc/lcf-edge/config.toml
    test -e "$root/$configuration" ||
        install -D -m 644 "$versions/$1/system/$configuration" "$root/$configuration"
    install -d -m 700 "$root/var/lib/private"
    test -e "$root/var/lib/private/lcf-edge" || install -d -m 750 "$root/var/lib/private/lcf-edge"
    test -e "$root/var/lib/lcf-edge" || ln -s private/lcf-edge "$root/var/lib/lcf-edge"
    if test -n "$was" && test "$was" != "$1"; then
        link "$was" "$previous"
    fi
    link "lcf-edge-versions/$1" "$current"
    install -d "$(dirname "$command")"
    link /opt/lcf-edge/bin/lcf-edge "$command"
    sync
}

# Let the system know, and the daemon run anew where it ran. Fails when it does not start.
restart() {
    if runs_systemd; then
        systemd-sysusers lcf-edge.conf
        systemctl daemon-reload
        systemctl restart systemd-modules-load
        udevadm control --reload
        udevadm trigger --action=add -s video4linux -s i2c-dev -s iio -s usb-serial -s tty
        systemctl reset-failed lcf-edge 'lcf-edge@*' 2>/dev/null || true
        test -z "$running" || systemctl restart $running
    fi
}

roll_back() {
    newer=$(linked "$current")
    older=$(linked "$previous")
    test -n "$older" || fail "there is no version before ${newer:-this one}; install it from its archive"
    activate "$older"
    restart || fail "$older does not start; journalctl -u lcf-edge"
    say "$older is current again; before it was $newer"
}

remove() {
    version=$(linked "$current")
    test -n "$version" || fail "no version is installed at $current"
    if runs_systemd; then
        systemctl disable --now lcf-edge lcf-edge-gate
        systemctl stop 'lcf-edge@*'
        systemctl disable lcf-edge@
    fi
    files_of "$version" | while read -r file; do
        rm -f "$root/$file"
    done
    rm -rf "$current" "$versions" "$command"
    if runs_systemd; then
        systemctl daemon-reload
        udevadm control --reload
    fi
    if test "${1:-}" = --purge; then
        rm -rf "$root/etc/lcf-edge" "$root"/etc/systemd/system/lcf-edge*.service.d \
            "$root/var/lib/private/lcf-edge" "$root"/var/lib/private/lcf-edge-* \
            "$root/var/lib/lcf-edge" "$root"/var/lib/lcf-edge-*
    fi
    say "$version is removed${1:+, with configuration and recordings}"
}

case "${1:-install} ${2:-}" in
"install " | "rollback " | "remove " | "remove --purge") ;;
*)
    printf '%s\n' "$usage" >&2
    exit 2
    ;;
esac
test -n "$root" || test "$(id -u)" -eq 0 || fail "this needs root: sudo $0 $*"
case "${1:-install}" in
install) install_version ;;
rollback) roll_back ;;
remove) remove "${2:-}" ;;
esac
