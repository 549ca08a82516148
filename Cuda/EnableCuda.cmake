# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Included by the root, because a language is enabled for the folder that asks and those below it.
if(BIGUS_WITH_CUDA STREQUAL "OFF")
  return()
endif()

if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
  find_program(BIGUS_NVCC nvcc PATHS "$ENV{CUDA_HOME}/bin" "$ENV{CUDA_PATH}/bin" /usr/local/cuda/bin
    DOC "The CUDA compiler")
  mark_as_advanced(BIGUS_NVCC)
  if(BIGUS_NVCC)
    set(ENV{CUDACXX} "${BIGUS_NVCC}")
  endif()
endif()

# Machine code from Turing to Hopper, and PTX of the last for whatever comes later.
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES AND NOT DEFINED ENV{CUDAARCHS})
  set(CMAKE_CUDA_ARCHITECTURES 75-real 80-real 86-real 89-real 90)
endif()
include(CheckLanguage)
check_language(CUDA)
if(NOT CMAKE_CUDA_COMPILER)
  if(BIGUS_WITH_CUDA STREQUAL "AUTO")
    message(STATUS "CUDA: no compiler found, left out")
    return()
  endif()
  message(FATAL_ERROR "BIGUS_WITH_CUDA is ${BIGUS_WITH_CUDA} but no working CUDA compiler was found. Put nvcc on PATH, "
    "set CUDACXX to it, or configure with -DBIGUS_WITH_CUDA=OFF.")
endif()
enable_language(CUDA)
