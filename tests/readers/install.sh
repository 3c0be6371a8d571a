#!/bin/sh
# Installs the reader of SINUMERIK motion that tests/controls/check_readers.rs compares with (PyPI: nc-gcode-interpreter, MIT) into an
# environment of its own outside of the tree. Does nothing when it is there.
set -eu
cd "$(dirname "$0")"
cache=${AXISCAL_READERS_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/axiscal-readers}
python=$cache/venv/bin/python
ready() { [ -x "$python" ] && cmp -s requirements.txt "$cache/requirements.txt"; }

if ! ready; then
    mkdir -p "$cache"
    if ! python3 -c 'import ensurepip' 2>/dev/null; then
        as_root=
        [ "$(id -u)" = 0 ] || as_root="sudo DEBIAN_FRONTEND=noninteractive"
        $as_root apt-get update -q
        $as_root apt-get install -y -q --no-install-recommends python3 python3-venv
    fi
    python3 -m venv "$cache/venv"
    try=1
    until "$python" -m pip install --quiet --disable-pip-version-check -r requirements.txt; do
        if [ "$try" -ge 5 ]; then
            echo "install.sh: pip failed $try times" >&2
            exit 1
        fi
        sleep $((try * 5))
        try=$((try + 1))
    done
    "$python" -c 'import nc_gcode_interpreter'
    cp requirements.txt "$cache/requirements.txt"
fi
echo "the readers of the tests are present"
