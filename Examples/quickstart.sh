#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# From a tracked sweep to a field, slices, a panel and a report, starting from a bare Debian 12.
#
#   Examples/quickstart.sh [SEQUENCE] [OUTPUT_FOLDER] [-- OPTIONS]
#
# SEQUENCE        a tracked sweep (.igs.mha .mha .mhd .nrrd .csv); without one a made-up sweep is used
# OUTPUT_FOLDER   default: $BIGUS_OUTPUT, else quickstart-output/ in the project
# OPTIONS         how to read the sequence, such as --config PlusConfig.xml (see 'bigus convert --help'),
#                 or what to make up, such as --probe convex (see 'bigus phantom --help')
set -euo pipefail

source_folder=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build_folder=$source_folder/build

positional=()
while (($#)) && [[ $1 != -- ]]; do
  case $1 in
    -h | --help) sed -n '2,9s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; exit ;;
    *) positional+=("$1"); shift ;;
  esac
done
[[ ${1:-} == -- ]] && shift
sequence=${positional[0]:-}
output=${positional[1]:-${BIGUS_OUTPUT:-$source_folder/quickstart-output}}
mkdir -p "$output"

"$source_folder/Testing/install-packages.sh"

echo "Building in $build_folder"
generator=()
[[ -e $build_folder/CMakeCache.txt ]] || generator=(-G Ninja -DCMAKE_BUILD_TYPE=Release)
cmake -S "$source_folder" -B "$build_folder" "${generator[@]}"
cmake --build "$build_folder" --parallel "$(nproc)" --target bigus BIGUSPython

export PATH=$build_folder/bin:$PATH PYTHONPATH=$build_folder/python PYTHONDONTWRITEBYTECODE=1 MPLBACKEND=Agg
sweep=$output/sweep.igs.mha

if [[ -z $sequence ]]; then
  # A hand-held linear probe over 24 mm: vessels, a cyst, a tumour and a bone, seen through a beam 0.8 mm thick.
  phantom=(--frames 64 --frame-spacing 0.4 --width 176 --height 176 --pixel-size 0.3)
  training=(--gaussians 150000 --time-limit 120)
  bigus phantom -o "$sweep" "${phantom[@]}" "$@"
else
  training=(--gaussians 150000 --time-limit 120)
  bigus convert "$sequence" "$sweep" "$@"
fi
bigus info "$sweep"

# How much of it fits into a few minutes, what to hold out and to stop by, and which planes to look at (planes.csv).
plan=$(/usr/bin/python3 "$source_folder/Examples/plan.py" "$sweep" "$output/planes.csv")
read -r reduce hold_out held_out_frame validation <<<"$plan"

bigus train "$sweep" -o "$output/field.vtp" --log "$output/training.csv" --json \
  --write-poses "$output/trained-poses.igs.mha" \
  --reduce "$reduce" --hold-out "$hold_out" --validation "$validation" "${training[@]}" >"$output/training.json"

slice() { bigus slice "$output/field.vtp" -o "$output/$1.png" "${@:2}"; }
echo "Held-out frame $held_out_frame, an orthogonal and an oblique plane"
slice held-out --poses "$output/trained-poses.igs.mha" --frames "$held_out_frame" --lit
slice orthogonal --poses "$output/planes.csv" --frames 0
slice oblique --poses "$output/planes.csv" --frames 1
if [[ -z $sequence ]]; then  # the phantom knows what is really there
  bigus phantom --truth "$output/planes.csv" --truth-frames 0 -o "$output/orthogonal-truth.png" "${phantom[@]}" "$@"
  bigus phantom --truth "$output/planes.csv" --truth-frames 1 -o "$output/oblique-truth.png" "${phantom[@]}" "$@"
fi

/usr/bin/python3 "$source_folder/Examples/report.py" "$output" --frame "$held_out_frame" --reduce "$reduce"
echo
cat "$output/report.txt"
echo
echo "See $output/panel.png and $output/training-curve.png"
