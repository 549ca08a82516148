#!/bin/bash -eu
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# What ClusterFuzzLite calls: SRC, WORK, OUT, CC, CXX, CFLAGS, CXXFLAGS and LIB_FUZZING_ENGINE come from it.

# The distribution's VTK and TBB were built with its own standard library, so the targets cannot have Clang's.
export CXXFLAGS=${CXXFLAGS//-stdlib=libc++/}
# CXXFLAGS say how to optimize. The old kind of library path holds for the libraries of libraries, too.
cmake -S "$SRC/bigus" -B "$WORK/bigus" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO= \
  -DCMAKE_C_FLAGS_RELWITHDEBINFO= -DBIGUS_WITH_FUZZERS=ON \
  -DBIGUS_FUZZING_ENGINE="$LIB_FUZZING_ENGINE" -DBIGUS_WITH_RENDERING=OFF -DBIGUS_WITH_PYTHON=OFF \
  -DBIGUS_WITH_CUDA=OFF -DCMAKE_INSTALL_RPATH='$ORIGIN/lib' -DCMAKE_BUILD_WITH_INSTALL_RPATH=ON \
  -DCMAKE_EXE_LINKER_FLAGS=-Wl,--disable-new-dtags -DCMAKE_SHARED_LINKER_FLAGS=-Wl,--disable-new-dtags
cmake --build "$WORK/bigus" --target fuzzers
mkdir -p "$OUT/lib"
cp -L "$WORK"/bigus/lib/*.so.1 "$OUT/lib"
ln -sfn ../lib "$WORK/bigus/fuzz/lib"  # where the library path points to
"$WORK/bigus/fuzz/fuzz-seeds" "$WORK/seeds"
for dictionary in "$WORK"/bigus/fuzz/fuzz-*.dict; do
  program=${dictionary%.dict}
  target=${program##*/fuzz-}
  cp "$program" "$OUT"
  # The distribution's libraries are not in the image that runs the targets; the C library is.
  ldd "$program" | awk '$3 ~ /^\// && $1 !~ /^lib(c|m|dl|rt|pthread|resolv)\.so/ { print $3 }' |
    xargs -r -I{} cp -Ln {} "$OUT/lib"
  cp "$dictionary" "$OUT"
  printf '[libfuzzer]\nmax_len = 65536\nentropic = 0\ntimeout = 10\n' > "$OUT/fuzz-$target.options"
  (cd "$WORK/seeds/$target" && zip -q "$OUT/fuzz-${target}_seed_corpus.zip" ./*)
done
