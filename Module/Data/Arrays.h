// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How the adapters look for arrays and make them. Private to Data.
#pragma once

#include <string>

#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkNew.h"

namespace bigus
{

/// The numeric array of that name and shape. Null when it is absent and not required; throws Error otherwise, so that
/// all messages about arrays read alike. `owner` begins the message.
vtkDataArray* FindArray(vtkFieldData* data, const std::string& owner, const char* name, int components,
                        vtkIdType tuples, bool required);

vtkNew<vtkDoubleArray> NewDoubles(const char* name, int components, vtkIdType tuples);

}  // namespace bigus
