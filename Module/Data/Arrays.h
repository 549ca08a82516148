// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How the adapters look for arrays and make them. Private to this project.
#pragma once

#include <string>

#include "vtkBigusDataModule.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkNew.h"

namespace bigus
{

/// The numeric array of that name and shape. Null when it is absent and not required; throws Error otherwise, so that
/// all messages about arrays read alike. `owner` begins the message.
VTKBIGUSDATA_EXPORT vtkDataArray* FindArray(vtkFieldData* data, const std::string& owner, const char* name,
                                            int components, vtkIdType tuples, bool required);

/// A named array of that shape, its values not yet set.
template <class Array>
vtkNew<Array> NewArray(const char* name, int components, vtkIdType tuples)
{
  vtkNew<Array> array;
  array->SetName(name);
  array->SetNumberOfComponents(components);
  array->SetNumberOfTuples(tuples);
  return array;
}

}  // namespace bigus
