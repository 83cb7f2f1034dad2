#!/bin/sh
# Makes a certificate authority and one certificate a program, for mutual TLS between them.
#
#   make_certificates.sh FOLDER NAME [ADDRESS] ...
#
# as in: make_certificates.sh certificates boat 192.168.2.2 sensors 192.168.2.2 operator 192.168.2.9
# NAME is what config/zenoh/boat.json5 gives rights to; ADDRESS (an IP address) is where others find
# that program. Copy to each machine its own NAME.key and NAME.pem, and ca.pem. Keep ca.key away
# from all of them: whoever has it can make any NAME.
set -eu
umask 077

[ $# -ge 2 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
folder=$1
shift
days=825
mkdir -p "$folder"
cd "$folder"

if [ ! -e ca.key ]; then
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days "$days" \
        -subj "/CN=twinscrew authority" -addext "keyUsage=critical,keyCertSign,cRLSign" \
        -keyout ca.key -out ca.pem 2>/dev/null
fi

while [ $# -gt 0 ]; do
    name=$1
    shift
    names="DNS:$name,DNS:localhost,IP:127.0.0.1"
    case ${1-} in
        [0-9]*.*) names="$names,IP:$1"; shift ;;
    esac
    openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes \
        -subj "/CN=$name" -keyout "$name.key" -out "$name.csr" 2>/dev/null
    printf 'subjectAltName=%s\nbasicConstraints=CA:FALSE\nextendedKeyUsage=serverAuth,clientAuth\n' \
        "$names" > "$name.ext"
    openssl x509 -req -in "$name.csr" -CA ca.pem -CAkey ca.key -CAcreateserial -days "$days" \
        -extfile "$name.ext" -out "$name.pem" 2>/dev/null
    rm "$name.csr" "$name.ext"
    echo "$folder/$name.pem"
done
