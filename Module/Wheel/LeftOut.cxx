// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// OpenCV's static libraries refer to LAPACK, BLAS and OpenGL, which are several times as large as all that Core uses of
// OpenCV. OpenCV calls LAPACK and BLAS for matrices above 100 x 100 only, and OpenGL for windows. Core has neither, so
// these stand in for them: if one is ever called, it says so instead of going on.
#include <string>

#include "Core/Model/Error.h"

#define BIGUS_LEFT_OUT(name)                                                             \
  extern "C" void name()                                                                 \
  {                                                                                      \
    throw bigus::Error("OpenCV calls " #name ", which this build of BIGUS leaves out."); \
  }

BIGUS_LEFT_OUT(cblas_cgemm)
BIGUS_LEFT_OUT(cblas_dgemm)
BIGUS_LEFT_OUT(cblas_sgemm)
BIGUS_LEFT_OUT(cblas_zgemm)
BIGUS_LEFT_OUT(dgels_)
BIGUS_LEFT_OUT(dgeqrf_)
BIGUS_LEFT_OUT(dgesdd_)
BIGUS_LEFT_OUT(dgesv_)
BIGUS_LEFT_OUT(dgetrf_)
BIGUS_LEFT_OUT(dposv_)
BIGUS_LEFT_OUT(dpotrf_)
BIGUS_LEFT_OUT(glXGetProcAddressARB)
BIGUS_LEFT_OUT(sgels_)
BIGUS_LEFT_OUT(sgeqrf_)
BIGUS_LEFT_OUT(sgesdd_)
BIGUS_LEFT_OUT(sgesv_)
BIGUS_LEFT_OUT(sgetrf_)
BIGUS_LEFT_OUT(sposv_)
BIGUS_LEFT_OUT(spotrf_)
