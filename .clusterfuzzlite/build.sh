#!/bin/bash -eu
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# What ClusterFuzzLite calls: CXX, CXXFLAGS, LIB_FUZZING_ENGINE and OUT come from it.
cmake -S "$SRC/bigus" -B "$WORK/bigus" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DBIGUS_WITH_FUZZERS=ON \
  -DBIGUS_FUZZING_ENGINE="$LIB_FUZZING_ENGINE" -DBIGUS_WITH_RENDERING=OFF -DBIGUS_WITH_PYTHON=OFF \
  -DBIGUS_WITH_CUDA=OFF -DCMAKE_INSTALL_RPATH='$ORIGIN/lib' -DCMAKE_BUILD_WITH_INSTALL_RPATH=ON
cmake --build "$WORK/bigus" --target fuzzers
LD_LIBRARY_PATH=$WORK/bigus/lib "$WORK/bigus/fuzz/fuzz-seeds" "$WORK/seeds"
mkdir -p "$OUT/lib"
cp -L "$WORK"/bigus/lib/*.so* "$OUT/lib"
for program in "$WORK"/bigus/fuzz/fuzz-*; do
  target=${program##*/fuzz-}
  [[ $target == seeds ]] && continue
  cp "$program" "$OUT"
  # The distribution's libraries are not in the image that runs the targets.
  ldd "$program" | awk '$3 ~ /^\// { print $3 }' | xargs -r -I{} cp -Ln {} "$OUT/lib"
  cp "$SRC/bigus/Testing/Fuzz/Dictionaries/$target.dict" "$OUT/fuzz-$target.dict"
  printf '[libfuzzer]\nmax_len = 1048576\n' > "$OUT/fuzz-$target.options"
  (cd "$WORK/seeds/$target" && zip -q "$OUT/fuzz-${target}_seed_corpus.zip" ./*)
done
