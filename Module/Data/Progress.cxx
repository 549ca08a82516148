// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Progress.h"

#include "vtkAlgorithm.h"
#include "vtkVersionMacros.h"

#define BIGUS_VTK_ABORTS_PIPELINES (VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 3, 0))

namespace bigus
{

bool ReportProgress(vtkAlgorithm* algorithm, double fraction)
{
  algorithm->UpdateProgress(fraction);
#if BIGUS_VTK_ABORTS_PIPELINES
  return !algorithm->CheckAbort();  // hears of an abort further down the pipeline as well
#else
  return !algorithm->GetAbortExecute();
#endif
}

void KeepOutput(vtkAlgorithm* algorithm)
{
#if BIGUS_VTK_ABORTS_PIPELINES
  algorithm->SetAbortOutput(false);
#else
  static_cast<void>(algorithm);
#endif
}

}  // namespace bigus
