// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Arrays.h"

#include "Core/Model/Error.h"
#include "Data/FieldShape.h"

namespace bigus
{

vtkDataArray* FindArray(vtkFieldData* data, const std::string& owner, const char* name, int components,
                        vtkIdType tuples, bool required)
{
  vtkAbstractArray* found = data->GetAbstractArray(name);
  if (!found)
  {
    if (required)
    {
      throw MissingArray(owner, name, components, tuples);
    }
    return nullptr;
  }
  vtkDataArray* array = vtkDataArray::SafeDownCast(found);
  Require(array, owner, ": the array ", name, " holds ", found->GetDataTypeAsString(), "; it must be numeric.");
  RequireArrayShape(owner, name, array->GetNumberOfComponents(), array->GetNumberOfTuples(), components, tuples);
  return array;
}

}  // namespace bigus
