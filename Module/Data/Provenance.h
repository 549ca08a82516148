// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where a field comes from: lines `key=value` in the field data's string array `Provenance`.
#pragma once

#include <string>
#include <vector>

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

/// All lines; none when the array is absent.
VTKBIGUSDATA_EXPORT std::vector<std::string> ProvenanceOf(vtkDataObject* data);

/// Replaces all lines; without any line the array is removed.
VTKBIGUSDATA_EXPORT void ReplaceProvenance(vtkDataObject* data, const std::vector<std::string>& lines);

/// Appends `key=value`, replacing an earlier line of that key.
VTKBIGUSDATA_EXPORT void SetProvenance(vtkDataObject* data, const std::string& key, const std::string& value);

/// The value of `key`; empty when it is not there.
VTKBIGUSDATA_EXPORT std::string GetProvenance(vtkDataObject* data, const std::string& key);

}  // namespace bigus
