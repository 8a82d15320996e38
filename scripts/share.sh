#!/usr/bin/env bash
# share.sh PROGRAM DIR: the program's man pages and completions, as they lie below a prefix's share.
set -euo pipefail
program=$1
share=$2

mkdir -p "$share/bash-completion/completions" "$share/zsh/site-functions" "$share/fish/vendor_completions.d"
"$program" man "$share/man/man1" 2>/dev/null
"$program" completions bash >"$share/bash-completion/completions/etendue"
"$program" completions zsh >"$share/zsh/site-functions/_etendue"
"$program" completions fish >"$share/fish/vendor_completions.d/etendue.fish"
