#!/bin/sh
# Installs what the rig needs from Debian: LinuxCNC for user space, halcompile, a C compiler and make.
# Does nothing when all of it is there. Installs as root, or through sudo.
set -eu

present() {
    command -v linuxcnc >/dev/null 2>&1 && command -v halcompile >/dev/null 2>&1 &&
        command -v gcc >/dev/null 2>&1 && command -v make >/dev/null 2>&1 && command -v python3 >/dev/null 2>&1 &&
        /usr/bin/python3 -c 'import linuxcnc, tomllib' >/dev/null 2>&1
}

if present; then
    echo "LinuxCNC is present"
    exit 0
fi
as_root=
if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null 2>&1 || { echo "install.sh: LinuxCNC is missing, and without sudo only root can install it" >&2; exit 1; }
    as_root="sudo DEBIAN_FRONTEND=noninteractive"
fi

export DEBIAN_FRONTEND=noninteractive
try=1
until $as_root apt-get update -q && $as_root apt-get install -y -q --no-install-recommends linuxcnc-uspace \
    linuxcnc-uspace-dev gcc libc6-dev make python3; do
    if [ "$try" -ge 5 ]; then
        echo "install.sh: apt-get failed $try times" >&2
        exit 1
    fi
    sleep $((try * 5))          # a mirror that is busy now is often well again in seconds
    try=$((try + 1))
done
present || { echo "install.sh: installed, but linuxcnc, halcompile or the Python module is still missing" >&2; exit 1; }
echo "LinuxCNC installed"
