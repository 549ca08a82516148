// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Which instruction sets kernels are compiled for. Include it before Highway.
#pragma once

// Vectors of unknown size cannot be kept in structures, as kernels do.
#define BIGUS_SCALABLE_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#ifdef BIGUS_FEW_KERNELS  // the better a set is, the lower its bit
#define HWY_DISABLED_TARGETS (BIGUS_SCALABLE_TARGETS | HWY_SSSE3 | HWY_SSE4 | (HWY_AVX2 - 1))
#else
#define HWY_DISABLED_TARGETS BIGUS_SCALABLE_TARGETS
#endif
