// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What Core asks of the library of the CUDA engine, for a library that computes by the emulation. It has the name of the
// real one, so that a test sees Core find it, load it and compute with it.
#include "Cuda/CudaLibrary.cu"
