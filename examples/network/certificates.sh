#!/bin/sh
# Certificates for a rover whose port is open to others, into this folder: sh certificates.sh rover.local planner wheels
# The first argument is the name or address by which others reach the rover, the rest are parties that may connect.
# Authorities and a rover's certificate that are here already are kept: run it again for further parties.
set -eu

host=$1
shift
case $host in
  *[!0-9.]*) host=DNS:$host ;;
  *) host=IP:$host ;;
esac

make() { # NAME COMMON_NAME OPTION...: NAME.key and NAME.pem
  name=$1 common=$2
  shift 2
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc -subj "/CN=$common" "$@" \
    -keyout "$name.key" -out "$name.pem" 2>/dev/null || { echo "$0: openssl 3 is needed" >&2; exit 1; }
}

authority() { # NAME COMMON_NAME
  test -e "$1.key" || make "$1" "$2" -days 3650 -addext keyUsage=critical,keyCertSign,cRLSign
}

party() { # AUTHORITY NAME COMMON_NAME OPTION...
  by=$1
  shift
  make "$@" -days 825 -CA "$by.pem" -CAkey "$by.key" -addext basicConstraints=critical,CA:FALSE
}

mkdir -p inner
authority ca rover-authority
authority inner-ca inner-authority # of the gate's certificates, by which the daemon knows for whom it connects
test -e rover.key || party ca rover rover -addext "subjectAltName=$host,DNS:localhost,IP:127.0.0.1"
for name in "$@"; do
  party ca "$name" "$name" -addext "subjectAltName=DNS:$name"
  party inner-ca "inner/$name" "$name"
done
