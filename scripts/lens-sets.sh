#!/bin/sh
# lens-sets.sh ETENDUE FOLDER...: how many lens files of other programs in the folders are read, and why others are not,
# with their numbers. scripts/lens_set_optiland.py makes such a folder of the lenses that optiland brings.
set -eu
[ $# -ge 2 ] || { sed -n '2,3p' "$0"; exit 2; }
etendue=$1
shift
all=$(mktemp)
trap 'rm -f "$all"' EXIT
find "$@" -type f \( -iname '*.zmx' -o -iname '*.seq' -o -iname '*.len' -o -iname '*.dat' -o -iname '*.txt' -o -iname '*.json' \) | sort |
    while read -r file; do
        ending=$(printf '%s' "${file##*.}" | tr 'A-Z' 'a-z')
        if why=$("$etendue" lens "$file" --json 2>&1 > /dev/null); then
            printf '%s\tread\n' "$ending"
        else
            # Without the file, its place and numbers, so that the same reasons are one.
            why=$(printf '%s' "$why" | head -n 1 | sed "s|.*${file##*/}[:,]* *||; s/line [0-9]*: //; s/\[[0-9]*\]/[]/g")
            printf '%s\trefused: %.100s\n' "$ending" "$why"
        fi
    done > "$all"
sort "$all" | uniq -c | sort -k2,2 -k1,1nr
