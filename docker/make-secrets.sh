#!/bin/sh
# Passwords, keys and certificates of scale.yaml, made once, each for the user that reads it:
#   sudo docker/make-secrets.sh            (docker/secrets; or another FOLDER as its argument)
# authority/ signs certificates for workers of further machines, and belongs into no container.
set -eu
umask 077

folder=${1:-$(dirname "$0")/secrets}
# As whom Touchline runs in its image.
owner=${OWNER:-10001:10001}
days=3650

if [ -e "$folder" ]; then
    echo "$folder already exists. What it holds is in use: delete it only with the volumes of the database and the store." >&2
    exit 1
fi
made=$(mktemp -d "$folder.XXXXXX")
trap 'rm -rf "$made"' EXIT
mkdir "$made/authority" "$made/cluster"

password=$(openssl rand -hex 24)
key=$(openssl rand -hex 10)
secret=$(openssl rand -hex 24)
printf %s "$password" >"$made/database_password"
printf '%s\n' "postgresql://touchline:$password@database/touchline" >"$made/database_url"
printf '[default]\naws_access_key_id = %s\naws_secret_access_key = %s\n' "$key" "$secret" >"$made/store_keys"
cat >"$made/store.json" <<END
{"identities": [{"name": "touchline", "credentials": [{"accessKey": "$key", "secretKey": "$secret"}],
  "actions": ["Read:touchline", "Write:touchline", "List:touchline"]}]}
END

# An authority of this installation alone: who has a key that it signed can run programs on every worker.
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days "$days" -subj "/CN=Touchline cluster" \
    -addext "keyUsage=critical,keyCertSign" -keyout "$made/authority/key.pem" -out "$made/cluster/ca.pem" 2>/dev/null
openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj "/CN=touchline" \
    -keyout "$made/cluster/key.pem" -out "$made/request.pem" 2>/dev/null
openssl x509 -req -in "$made/request.pem" -CA "$made/cluster/ca.pem" -CAkey "$made/authority/key.pem" \
    -set_serial "0x$(openssl rand -hex 8)" -days "$days" -out "$made/cluster/cert.pem" 2>/dev/null
rm "$made/request.pem"

# PostgreSQL and the store run as users of their images; outside nobody comes past the folder, which is its owner's alone.
chmod 444 "$made/database_password" "$made/store.json"
chown -R "$owner" "$made/database_url" "$made/store_keys" "$made/cluster"
mv "$made" "$folder"
trap - EXIT
echo "$folder holds the secrets of this installation. Keep a copy where backups are kept."
