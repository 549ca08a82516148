// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a field's standard error rests on (Core/StandardError): bytes in the field data's array `StandardError`.
#pragma once

#include <string>

#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkDataObject;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// The bytes; none when the array is absent. Throws Error for an array that is none of bytes.
VTKBIGUSDATA_EXPORT std::string StandardErrorOf(vtkDataObject* data);

/// Replaces them; of none the array is removed.
VTKBIGUSDATA_EXPORT void ReplaceStandardError(vtkDataObject* data, const std::string& bytes);

}  // namespace bigus
