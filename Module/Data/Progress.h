// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Progress and abort, the same for every version of VTK.
#pragma once

#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithm;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// Reports progress from 0 to 1 to the algorithm's observers; false when they asked it to stop.
VTKBIGUSDATA_EXPORT bool ReportProgress(vtkAlgorithm* algorithm, double fraction);

/// Lets an algorithm that was asked to stop keep what it has; VTK empties outputs then, from 9.3 on.
VTKBIGUSDATA_EXPORT void KeepOutput(vtkAlgorithm* algorithm);

}  // namespace bigus
