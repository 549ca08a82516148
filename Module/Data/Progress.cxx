// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Progress.h"

#include "vtkAlgorithm.h"
#include "vtkVersionMacros.h"

namespace bigus
{

bool ReportProgress(vtkAlgorithm* algorithm, double fraction)
{
  algorithm->UpdateProgress(fraction);
#if VTK_MAJOR_VERSION > 9 || (VTK_MAJOR_VERSION == 9 && VTK_MINOR_VERSION >= 3)
  return !algorithm->CheckAbort();  // hears of an abort further down the pipeline as well
#else
  return !algorithm->GetAbortExecute();
#endif
}

}  // namespace bigus
