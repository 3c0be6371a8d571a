#!/bin/sh
# Installs what the browser tests need: Debian's Chromium, Node, and (by the package lock) a driver and axe.
# Does nothing when all of it is there. Installs as root, or through sudo.
set -eu
cd "$(dirname "$0")"

if ! command -v chromium >/dev/null 2>&1 || ! command -v node >/dev/null 2>&1 || ! command -v npm >/dev/null 2>&1; then
    packages=
    command -v chromium >/dev/null 2>&1 || packages="$packages chromium"
    command -v node >/dev/null 2>&1 || packages="$packages nodejs"
    command -v npm >/dev/null 2>&1 || packages="$packages npm"
    as_root=
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null 2>&1 || { echo "install.sh:$packages missing, and without sudo only root can install" >&2; exit 1; }
        as_root="sudo DEBIAN_FRONTEND=noninteractive"
    fi
    export DEBIAN_FRONTEND=noninteractive
    try=1
    # shellcheck disable=SC2086 # several words are several packages
    until $as_root apt-get update -q && $as_root apt-get install -y -q --no-install-recommends $packages; do
        if [ "$try" -ge 5 ]; then
            echo "install.sh: apt-get failed $try times" >&2
            exit 1
        fi
        sleep $((try * 5))
        try=$((try + 1))
    done
fi
# the lock says which versions, with their sums
if [ ! -d node_modules/playwright-core ] || [ ! -d node_modules/axe-core ] || [ package-lock.json -nt node_modules/.package-lock.json ]; then
    npm ci --ignore-scripts --no-audit --no-fund
fi
echo "what the browser tests need is present"
