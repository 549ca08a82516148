// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// cuFFT, where it is installed. Private to Cuda.
#pragma once

#include <CudaRuntime.h>

namespace bigus::cuda
{

/// The functions of cuFFT used here. It is loaded when first wanted: everything else works without it, and a library
/// of 200 MB is not linked into ours.
struct FourierLibrary
{
  int (*planMany)(int* plan, int rank, int* size, int* inEmbed, int inStride, int inDistance, int* outEmbed,
                  int outStride, int outDistance, int type, int batch);
  int (*setStream)(int plan, cudaStream_t stream);
  int (*realToComplex)(int plan, float* in, float* out);
  int (*complexToReal)(int plan, float* in, float* out);
  int (*destroy)(int plan);

  /// Null when it is not installed.
  static const FourierLibrary* Find();
};

}  // namespace bigus::cuda
