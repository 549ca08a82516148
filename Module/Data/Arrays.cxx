// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Arrays.h"

#include "Core/Model/Error.h"

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
      throw Error(owner + ": the array " + name + " is missing; it needs " + std::to_string(tuples) + " tuples of " +
                  std::to_string(components) + ".");
    }
    return nullptr;
  }
  vtkDataArray* array = vtkDataArray::SafeDownCast(found);
  if (!array)
  {
    throw Error(owner + ": the array " + name + " holds " + found->GetDataTypeAsString() + "; it must be numeric.");
  }
  if (array->GetNumberOfComponents() != components || array->GetNumberOfTuples() != tuples)
  {
    throw Error(owner + ": the array " + name + " has " + std::to_string(array->GetNumberOfTuples()) + " tuples of " +
                std::to_string(array->GetNumberOfComponents()) + "; expected " + std::to_string(tuples) + " of " +
                std::to_string(components) + ".");
  }
  return array;
}

}  // namespace bigus
